//! The script of a page, and the policy that lets nothing else run.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

/// Values under the cursor, zoom and the legend.
pub(crate) const SCRIPT: &str = include_str!("page.js");

/// The element for the head of a page: nothing is loaded, and of styles and scripts only those with these bytes are used.
pub(crate) fn element(style: &str) -> String {
    let hash = |text: &str| STANDARD.encode(Sha256::digest(text));
    format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; base-uri 'none'; form-action 'none'; \
         style-src 'sha256-{}'; script-src 'sha256-{}'\">\n",
        hash(style),
        hash(SCRIPT)
    )
}
