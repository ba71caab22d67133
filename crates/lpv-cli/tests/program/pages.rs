//! Pages in a browser: what the first screen shows, and what keys and the mouse do.

use crate::browser::{Browser, CELLS, ESCAPE, RIGHT, SHIFT, TAB};
use crate::common::{Desk, machine_bundle};
use serde_json::Value;

const SCREEN: [u32; 2] = [1280, 800];
const PHONE: [u32; 2] = [390, 844];

/// The drawing that the style sheet shows.
const SHOWN: &str = "[...document.querySelectorAll('.drawing')].find(d => d.offsetWidth)";

#[test]
fn a_page_answers_on_its_first_screen_and_obeys_keys_and_mouse() {
    let desk = Desk::new();
    let Some(browser) = Browser::start() else { return };
    machine_bundle(&desk);
    desk.done("identify bundle -o result/model.json");
    desk.done("report result");
    let page = desk.path("result/report.html");
    for size in [SCREEN, PHONE] {
        browser.open(&page, size);
        first_screen(&browser, size);
        keys(&browser);
        mouse(&browser);
        assert_eq!(browser.complaints(), Value::Array(Vec::new()), "{size:?}");
        browser.open(&page, size);
        compare(&browser, size);
    }
    // Beside another model both are judged, and none is on the page twice.
    desk.write("result/other.json", desk.bytes("result/model.json"));
    desk.done("report result");
    for size in [SCREEN, PHONE] {
        browser.open(&page, size);
        first_screen(&browser, size);
    }
    assert_eq!(browser.complaints(), Value::Array(Vec::new()));
}

/// Verdict and at least the upper half of the figure are seen, and nothing scrolls sideways.
fn first_screen(browser: &Browser, [width, height]: [u32; 2]) {
    let verdict = browser.number("document.querySelector('.judgement').getBoundingClientRect().bottom");
    let middle = browser.number(&format!(
        "(r => (r.top + r.bottom) / 2)({SHOWN}.querySelector('svg').getBoundingClientRect())"
    ));
    assert!(
        verdict < middle && middle <= f64::from(height),
        "{verdict}, {middle} of {height}"
    );
    let wide = browser.number("document.documentElement.scrollWidth");
    assert!(wide <= f64::from(width), "{wide} px wide");
    let beyond = browser.text(
        "[...document.querySelectorAll('main *')].filter(e => !e.closest('.scroll, pre') && \
         e.getBoundingClientRect().right > innerWidth + 1).map(e => e.tagName)",
    );
    assert_eq!(beyond, "");
}

fn readout(browser: &Browser) -> String {
    browser.text("document.querySelector('.tip:not([hidden])')?.textContent")
}

/// Numbers at the ticks of the panels of one drawing.
fn ticks(browser: &Browser, drawing: &str) -> String {
    browser.text(&format!(
        "[...{drawing}.querySelectorAll('.ax text, .live text')].filter(t => t.getBoundingClientRect().width).map(t => t.textContent)"
    ))
}

fn keys(browser: &Browser) {
    browser.run("document.body.tabIndex = -1; document.body.focus()");
    let focused = || browser.text("document.activeElement.getAttribute('class')");
    (0..60).find(|_| {
        browser.press(&[TAB]);
        focused() == "hit"
    });
    assert_eq!(focused(), "hit");
    browser.press(&[RIGHT]);
    let first = readout(browser);
    browser.press(&[RIGHT, RIGHT]);
    let third = readout(browser);
    assert!(
        first.contains(": ") && third.contains(": ") && first != third,
        "{first}, {third}"
    );

    // Another panel of this x axis goes along.
    let label = browser.text("document.activeElement.parentNode.dataset.xl");
    let other = format!(
        "[...document.querySelectorAll('.drawing')].filter(d => d.offsetWidth && d.querySelector('[data-xl=\"{label}\"]')).at(-1)"
    );
    let before = [ticks(browser, SHOWN), ticks(browser, &other)];
    browser.press(&['+', '+']);
    let near = [ticks(browser, SHOWN), ticks(browser, &other)];
    assert!(before[0] != near[0] && before[1] != near[1], "{near:?}");
    browser.press(&[SHIFT, RIGHT]);
    assert_ne!(near[0], ticks(browser, SHOWN));
    browser.press(&[ESCAPE]);
    assert_eq!(before, [ticks(browser, SHOWN), ticks(browser, &other)]);

    let off = || browser.number(&format!("{SHOWN}.querySelectorAll('[data-t].off').length"));
    browser.run(&format!("{SHOWN}.querySelector('.entry').focus()"));
    browser.press(&['\u{e007}']);
    assert!(off() > 0.0 && browser.text("document.activeElement.getAttribute('aria-pressed')") == "false");
    browser.press(&[' ']);
    assert!(off() == 0.0);
}

fn mouse(browser: &Browser) {
    browser.run(&format!("{SHOWN}.scrollIntoView({{block: 'center'}})"));
    let side = |name: &str| {
        browser.number(&format!(
            "{SHOWN}.querySelector('.hit').getBoundingClientRect().{name}"
        ))
    };
    let [left, top, width, height] = ["left", "top", "width", "height"].map(side);
    let at = |u: f64, v: f64| [left + u * width, top + v * height];
    let before = ticks(browser, SHOWN);
    browser.drag(&[at(0.3, 0.2), at(0.5, 0.5), at(0.7, 0.9)]);
    assert_ne!(before, ticks(browser, SHOWN));
    browser.drag(&[at(0.5, 0.5), at(0.5, 0.5)]);
    assert!(readout(browser).contains(": "));
    browser.double_click(at(0.5, 0.5));
    assert_eq!(before, ticks(browser, SHOWN));
}

/// The first screen beside the one that was looked at, in coarse cells, so that fonts do not matter. `LPV_BLESS_PAGES` keeps this
/// one.
fn compare(browser: &Browser, [width, height]: [u32; 2]) {
    let found = browser.fingerprint(&browser.picture());
    assert_eq!(found.len(), CELLS.0 * CELLS.1);
    let file = format!(
        "{}/tests/program/pages-{width}x{height}.txt",
        env!("CARGO_MANIFEST_DIR")
    );
    let lines = found.chunks(CELLS.0).map(|row| {
        let row: Vec<String> = row.iter().map(|v| format!("{v:.0}")).collect();
        row.join(" ") + "\n"
    });
    if std::env::var_os("LPV_BLESS_PAGES").is_some() {
        std::fs::write(&file, lines.collect::<String>()).unwrap();
        return;
    }
    let kept = std::fs::read_to_string(&file).unwrap();
    let kept: Vec<f64> = kept.split_whitespace().map(|v| v.parse().unwrap()).collect();
    let differences: Vec<f64> = found.iter().zip(&kept).map(|(a, b)| (a - b).abs()).collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    let far = differences.iter().filter(|d| **d > 50.0).count();
    assert!(
        kept.len() == found.len() && mean < 6.0 && far < 20,
        "mean {mean:.1}, {far} cells differ"
    );
}
