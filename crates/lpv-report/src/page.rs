//! One page with everything in it.

use crate::cell::{Cell, Verdict};
use crate::{Figure, ReportError, Table, policy, style, table, text};

/// Stands near the beginning of every page, so that a page of ours is told from others.
pub const GENERATOR: &str = "<meta name=\"generator\" content=\"lpv-report\">";

/// A self-contained page: no request, light and dark, for a screen, a phone or paper. Its script adds values, zoom and a legend
/// that turns series off; without it the figures stay as they are drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Page {
    /// Title of the document.
    pub title: String,
    /// One line under the title; may be empty.
    pub subtitle: String,
    /// Name and value of what identifies the run (seed, commit, hash of the data), shown at the end.
    pub facts: Vec<(String, String)>,
    /// What the page says first: the judgement and the figure that shows it, before contents and sections; may be empty.
    pub lead: Vec<Block>,
    /// The sections in order; with more than two a table of contents is put before them.
    pub sections: Vec<Section>,
}

/// A part of the page under its own heading.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// What it holds, in order.
    pub blocks: Vec<Block>,
}

/// A piece of a section. Text may use `_{..}` and `^{..}`, except in code; everything is escaped.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Block {
    /// A heading below that of the section.
    Heading(String),
    /// A paragraph.
    Paragraph(String),
    /// A paragraph that stands out: a limitation, a warning.
    Note(String),
    /// A line in small print: the numbers behind a judgement.
    Aside(String),
    /// The judgement of what follows, in a colour and in words.
    Judgement(Tone, String),
    /// Points of a list.
    List(Vec<String>),
    /// Large numbers with labels.
    KeyFigures(Vec<KeyFigure>),
    /// A table.
    Table(Table),
    /// A figure with its caption.
    Figure(Box<Figure>),
    /// Code or commands, as they are.
    Code(String),
}

/// How a judgement sounds; its colour never says it alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// To be used with care.
    Caution,
    /// Not to be used.
    Bad,
}

impl Tone {
    fn class(self) -> &'static str {
        match self {
            Self::Good => "ok",
            Self::Caution => "care",
            Self::Bad => "ko",
        }
    }
}

/// A large number with a label under it.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyFigure {
    /// The number, usually; a bar becomes a mark beside it.
    pub value: Cell,
    /// What it is.
    pub label: String,
    /// A remark under the label; may be empty.
    pub remark: String,
    /// Colour of the tile; without one that of the bar of its value.
    pub tone: Option<Tone>,
}

impl KeyFigure {
    /// A number with its label.
    pub fn new(value: Cell, label: impl Into<String>) -> Self {
        Self {
            value,
            label: label.into(),
            remark: String::new(),
            tone: None,
        }
    }

    /// The colour of the tile.
    pub fn tone(mut self, tone: Tone) -> Self {
        self.tone = Some(tone);
        self
    }

    /// A remark under the label.
    pub fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remark = remark.into();
        self
    }
}

impl Section {
    /// A section without content.
    pub fn new(heading: impl Into<String>) -> Self {
        Self {
            heading: heading.into(),
            blocks: Vec::new(),
        }
    }

    /// Adds any block.
    pub fn block(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// Adds a heading below that of the section.
    pub fn heading(self, text: impl Into<String>) -> Self {
        self.block(Block::Heading(text.into()))
    }

    /// Adds a paragraph.
    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.block(Block::Paragraph(text.into()))
    }

    /// Adds a paragraph that stands out.
    pub fn note(self, text: impl Into<String>) -> Self {
        self.block(Block::Note(text.into()))
    }

    /// Adds a judgement.
    pub fn judgement(self, tone: Tone, text: impl Into<String>) -> Self {
        self.block(Block::Judgement(tone, text.into()))
    }

    /// Adds a list.
    pub fn list<S: Into<String>>(self, points: impl IntoIterator<Item = S>) -> Self {
        self.block(Block::List(points.into_iter().map(Into::into).collect()))
    }

    /// Adds large numbers.
    pub fn key_figures(self, figures: impl IntoIterator<Item = KeyFigure>) -> Self {
        self.block(Block::KeyFigures(figures.into_iter().collect()))
    }

    /// Adds a table.
    pub fn table(self, table: Table) -> Self {
        self.block(Block::Table(table))
    }

    /// Adds a figure.
    pub fn figure(self, figure: Figure) -> Self {
        self.block(Block::Figure(Box::new(figure)))
    }

    /// Adds code or commands.
    pub fn code(self, code: impl Into<String>) -> Self {
        self.block(Block::Code(code.into()))
    }
}

impl Page {
    /// A page without sections.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            ..Self::default()
        }
    }

    /// One line under the title.
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = subtitle.into();
        self
    }

    /// Adds something that identifies the run.
    pub fn fact(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.facts.push((name.into(), value.into()));
        self
    }

    /// Adds to what the page says first.
    pub fn lead(mut self, blocks: impl IntoIterator<Item = Block>) -> Self {
        self.lead.extend(blocks);
        self
    }

    /// Adds a section.
    pub fn section(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The page as one HTML document; the same page gives the same bytes.
    ///
    /// # Errors
    /// The page has no section, or one of its figures or tables is inconsistent.
    pub fn to_html(&self) -> Result<String, ReportError> {
        if self.sections.is_empty() {
            return Err(ReportError::EmptyPage {
                page: self.title.clone(),
            });
        }
        let mut out = String::from("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
        out.push_str(GENERATOR);
        out.push_str("\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n");
        out.push_str("<meta name=\"color-scheme\" content=\"light dark\">\n");
        let style = style::sheet();
        out.push_str(&policy::element(&style));
        out.push_str(&format!(
            "<title>{}</title>\n<style>{style}",
            text::escape(&self.title)
        ));
        out.push_str("</style>\n</head>\n<body>\n<main>\n<header>\n");
        out.push_str(&format!("<h1>{}</h1>\n", text::to_html(&self.title)));
        if !self.subtitle.is_empty() {
            out.push_str(&format!(
                "<p class=\"sub\">{}</p>\n",
                text::to_html(&self.subtitle)
            ));
        }
        out.push_str("</header>\n");
        let mut figures = 0;
        for block in &self.lead {
            self::block(&mut out, block, &mut figures)?;
        }
        self.contents(&mut out);
        for (index, section) in self.sections.iter().enumerate() {
            let heading = text::to_html(&section.heading);
            out.push_str(&format!("<section id=\"s{}\">\n<h2>{heading}</h2>\n", index + 1));
            for block in &section.blocks {
                self::block(&mut out, block, &mut figures)?;
            }
            out.push_str("</section>\n");
        }
        if !self.facts.is_empty() {
            out.push_str("<footer><dl>\n");
            for (name, value) in &self.facts {
                let (name, value) = (text::to_html(name), text::escape(value));
                out.push_str(&format!("<div><dt>{name}</dt><dd>{value}</dd></div>\n"));
            }
            out.push_str("</dl></footer>\n");
        }
        out.push_str("</main>\n");
        if figures > 0 {
            out.push_str(&format!("<script>{}</script>\n", policy::SCRIPT));
        }
        out.push_str("</body>\n</html>\n");
        Ok(out)
    }

    fn contents(&self, out: &mut String) {
        if self.sections.len() < 3 {
            return;
        }
        out.push_str("<nav aria-label=\"Contents\"><ol>\n");
        for (index, section) in self.sections.iter().enumerate() {
            let heading = text::to_html(&section.heading);
            out.push_str(&format!("<li><a href=\"#s{}\">{heading}</a></li>\n", index + 1));
        }
        out.push_str("</ol></nav>\n");
    }
}

fn block(out: &mut String, block: &Block, figures: &mut usize) -> Result<(), ReportError> {
    match block {
        Block::Heading(heading) => out.push_str(&format!("<h3>{}</h3>\n", text::to_html(heading))),
        Block::Paragraph(paragraph) => out.push_str(&format!("<p>{}</p>\n", text::to_html(paragraph))),
        Block::Note(note) => out.push_str(&format!("<p class=\"note\">{}</p>\n", text::to_html(note))),
        Block::Aside(line) => out.push_str(&format!("<p class=\"aside\">{}</p>\n", text::to_html(line))),
        Block::Judgement(tone, words) => out.push_str(&format!(
            "<p class=\"judgement {}\">{}</p>\n",
            tone.class(),
            text::to_html(words)
        )),
        Block::List(points) => {
            let items: String = points
                .iter()
                .map(|p| format!("<li>{}</li>\n", text::to_html(p)))
                .collect();
            out.push_str(&format!("<ul>\n{items}</ul>\n"));
        }
        Block::KeyFigures(keys) => {
            out.push_str("<div class=\"keys\">\n");
            keys.iter().for_each(|key| key_figure(out, key));
            out.push_str("</div>\n");
        }
        Block::Table(table) => out.push_str(&table.to_html()?),
        Block::Figure(figure) => {
            *figures += 1;
            let (broad, narrow) = figure.to_inline_svg(*figures)?;
            let width = if figure.columns > 1 { " wide" } else { "" };
            out.push_str(&format!("<figure class=\"fig{width}\">\n"));
            match narrow {
                Some(narrow) => out.push_str(&format!(
                    "<div class=\"drawing broad\">{broad}</div>\n<div class=\"drawing narrow\">{narrow}</div>\n"
                )),
                None => out.push_str(&format!("<div class=\"drawing scroll\">{broad}</div>\n")),
            }
            let caption = text::to_html(&figure.caption);
            out.push_str(&format!(
                "<figcaption><b>Figure {figures}.</b> {caption}</figcaption></figure>\n"
            ));
        }
        Block::Code(code) => out.push_str(&format!("<pre><code>{}</code></pre>\n", text::escape(code))),
    }
    Ok(())
}

fn key_figure(out: &mut String, key: &KeyFigure) {
    let by_bar = key.value.verdict().map(|verdict| match verdict {
        Verdict::Pass => Tone::Good,
        Verdict::Fail => Tone::Bad,
    });
    let class = key
        .tone
        .or(by_bar)
        .map_or(String::new(), |tone| format!(" {}", tone.class()));
    let (value, label) = (text::to_html(&key.value.markup()), text::to_html(&key.label));
    out.push_str(&format!(
        "<div class=\"key{class}\"><div class=\"value\">{value}</div>"
    ));
    out.push_str(&format!("<div class=\"label\">{label}</div>"));
    let bar = table::bar_html(&key.value);
    if !bar.is_empty() || !key.remark.is_empty() {
        let separator = if bar.is_empty() || key.remark.is_empty() {
            ""
        } else {
            " · "
        };
        let (bar, remark) = (bar.trim(), text::to_html(&key.remark));
        out.push_str(&format!("<div class=\"remark\">{bar}{separator}{remark}</div>"));
    }
    out.push_str("</div>\n");
}
