//! The style sheet of a page.

use crate::colour::PALETTE;
use crate::svg::{PAPER, TONES, Tone};

/// Fixed rules, then the dark values of the drawings' classes, then the rules for paper.
pub(crate) fn sheet() -> String {
    let mut out = include_str!("page.css").to_owned();
    out.push_str("@media screen and (prefers-color-scheme:dark){\n");
    for Tone(class, _, dark) in TONES {
        let paint = if matches!(class, "fr" | "gr" | "gf") {
            "stroke"
        } else {
            "fill"
        };
        out.push_str(&format!(".{class}{{{paint}:{dark}}}\n"));
    }
    // The rim of text over data is drawn in the colour of the ground.
    let Tone(_, _, ground) = PAPER;
    out.push_str(&format!("text[stroke]{{stroke:{ground}}}\n"));
    for (slot, (_, dark)) in PALETTE.iter().enumerate() {
        out.push_str(&format!(".s{slot}{{stroke:{dark}}}.f{slot}{{fill:{dark}}}\n"));
    }
    out.push_str("}\n@media print{\n");
    // A printer has white paper whatever the screen prefers.
    out.push_str(
        ":root{color-scheme:light;--ground:#fff;--card:#fff;--text:#000;--soft:#444;--rule:#bbb;--link:#000;\
         --good:#00513a;--bad:#8a2f00}\n",
    );
    out.push_str("body{font-size:10.5pt}main{max-width:none;padding:0}nav,.tools,.tip{display:none}\n");
    out.push_str(".fig,.key,tr,pre{break-inside:avoid}h2,h3{break-after:avoid}.fig{border:0;padding:0}\n");
    out.push_str(".scroll svg{min-width:0}.scroll{overflow:visible}pre{white-space:pre-wrap}\n}\n");
    out
}
