//! Figures (SVG, PNG) and one self-contained HTML page
