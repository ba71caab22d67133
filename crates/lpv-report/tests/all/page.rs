//! The page from the outside: self-contained, escaped, the same twice.

use lpv_report::{
    Axis, Bar, Block, Cell, Figure, Format, KeyFigure, Page, Panel, ReportError, Section, Series, Table,
};
use proptest::prelude::*;
use resvg::usvg::roxmltree::{Document, ParsingOptions};

fn figure(title: &str) -> Figure {
    let panel = Panel::new(Axis::linear("x"), Axis::log("y"))
        .series(Series::line(vec![(0.0, 1.0), (1.0, 2.0)]).label("a"));
    Figure::new(title).caption("A caption with W_{1}.").panel(panel)
}

fn page() -> Page {
    Page::new("Report")
        .subtitle("for a test")
        .section(
            Section::new("Numbers")
                .key_figures([KeyFigure::new(
                    Cell::decibel(-62.1, 1).bar(Bar::AtMost(-40.0)),
                    "error",
                )])
                .table(Table::new("T", ["a"]).row([Cell::number(1e-7, Format::Significant(2)).unit("m")])),
        )
        .section(
            Section::new("Figures")
                .figure(figure("one"))
                .figure(figure("two")),
        )
        .section(
            Section::new("Text")
                .paragraph("p")
                .note("n")
                .list(["l"])
                .heading("h")
                .code("x < y"),
        )
        .fact("seed", "42")
}

/// The text of an element of a page, empty without one.
fn element<'h>(html: &'h str, name: &str) -> &'h str {
    let after = html.split(&format!("<{name}>")).nth(1).unwrap_or_default();
    after.split(&format!("</{name}>")).next().unwrap_or_default()
}

/// The page as XML: the void elements of the head are closed, doctype and script are left out.
fn well_formed(html: &str) -> Result<(), String> {
    let mut xml = html
        .replace(element(html, "script"), "")
        .replace("<!DOCTYPE html>", "")
        .replace("&nbsp;", "\u{a0}");
    for line in html.lines().filter(|line| line.starts_with("<meta ")) {
        xml = xml.replace(line, "");
    }
    let options = ParsingOptions {
        nodes_limit: u32::MAX,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(&xml, options)
        .map(|_| ())
        .map_err(|error| error.to_string())
}

#[test]
fn the_page_loads_nothing() {
    let html = page().to_html().unwrap();
    for forbidden in [
        "://",
        "<script ",
        "<link",
        "<img",
        "@import",
        "src=",
        "@font-face",
        "url(//",
    ] {
        assert!(!html.contains(forbidden), "{forbidden}");
    }
    // Nothing is asked for from the script either.
    for forbidden in [
        "fetch",
        "XMLHttp",
        "import",
        "eval",
        "innerHTML",
        "cookie",
        "Storage",
    ] {
        assert!(!element(&html, "script").contains(forbidden), "{forbidden}");
    }
    // Every reference points into the page itself.
    for part in html.split("href=\"").skip(1).chain(html.split("url(").skip(1)) {
        assert!(part.starts_with('#'), "{}", &part[..20.min(part.len())]);
    }
    assert!(html.contains("default-src 'none'"));
    assert!(html.contains("prefers-color-scheme:dark") && html.contains("@media print"));
}

#[test]
fn the_page_is_well_formed_and_its_ids_differ() {
    let html = page().to_html().unwrap();
    well_formed(&html).unwrap();
    let mut ids: Vec<&str> = html
        .split(" id=\"")
        .skip(1)
        .filter_map(|part| part.split('"').next())
        .collect();
    let all = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!((ids.len(), all), (7, 7), "{ids:?}");
    assert_eq!(html, page().to_html().unwrap());
}

#[test]
fn the_policy_names_the_style_and_the_script_by_their_bytes() {
    use base64::{Engine, engine::general_purpose::STANDARD};
    use sha2::{Digest, Sha256};
    let html = page().to_html().unwrap();
    let style = element(&html, "style");
    assert!(style.len() > 1000 && element(&html, "script").len() > 1000);
    for (name, text) in [("style-src", style), ("script-src", element(&html, "script"))] {
        let allowed = format!("{name} 'sha256-{}'", STANDARD.encode(Sha256::digest(text)));
        assert!(html.contains(&allowed), "{allowed}");
    }
    assert!(!html.contains("unsafe-inline") && !html.contains(" style=\"") && !html.contains(" onclick"));
    let plain = Page::new("P")
        .section(Section::new("S").paragraph("no figure"))
        .to_html()
        .unwrap();
    assert!(!plain.contains("<script>"));
}

#[test]
fn what_the_script_needs_is_on_the_page_and_what_it_makes_is_not() {
    let html = page().to_html().unwrap();
    let (still, _) = html.split_once("<script>").unwrap();
    for hook in [
        "data-x=\"linear 0e0 1e0\"",
        "data-y=\"log ",
        "data-xl=\"x\" data-yl=\"y\" data-n=\"xy\"",
        "<g data-t=\"line\" data-k=\"0\">",
        "<g class=\"entry\" data-k=\"0\" data-box=\"",
    ] {
        // Two figures, each also drawn for a phone.
        assert_eq!(still.matches(hook).count(), 4, "{hook}");
    }
    assert!(!still.contains("<button") && !still.contains("tabindex"));
    // A drawing of its own has none of it.
    assert!(!figure("one").to_svg().unwrap().contains("data-"));
}

#[test]
fn what_is_wrong_inside_comes_out() {
    assert!(matches!(
        Page::new("P").to_html(),
        Err(ReportError::EmptyPage { .. })
    ));
    let bad = Page::new("P").section(Section::new("S").figure(Figure::new("F")));
    assert!(matches!(bad.to_html(), Err(ReportError::EmptyFigure { .. })));
    let bad = Page::new("P").section(Section::new("S").table(Table::new("T", ["a"]).row([])));
    assert!(matches!(
        bad.to_html(),
        Err(ReportError::RowWidth {
            row: 0,
            expected: 1,
            found: 0,
            ..
        })
    ));
}

proptest! {
    #[test]
    fn no_text_escapes_its_element(text in any::<String>(), value in any::<f64>(), bar in any::<f64>()) {
        let cell = || Cell::number(value, Format::Significant(3)).unit(text.clone()).bar(Bar::AtLeast(bar));
        let section = Section::new(text.clone())
            .paragraph(text.clone())
            .note(text.clone())
            .heading(text.clone())
            .list([text.clone()])
            .code(text.clone())
            .key_figures([KeyFigure::new(cell(), text.clone()).remark(text.clone())])
            .table(Table::new(text.clone(), [text.clone()]).row([cell()]).row([Cell::text(text.clone())]))
            .block(Block::Figure(Box::new(figure(&text).caption(text.clone()))));
        let page = Page::new(text.clone()).subtitle(text.clone()).fact(text.clone(), text.clone()).section(section);
        let html = page.to_html().unwrap();
        prop_assert!(well_formed(&html).is_ok(), "{:?}", well_formed(&html));
    }
}
