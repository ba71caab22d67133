//! What a command leaves on standard output, whole or in short, and its exit code.

use anstyle::{AnsiColor, Style};
use std::io::Write;

/// What a judged result is worth, as far as a colour tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tone {
    Good,
    Doubtful,
    /// Not to be used: exit code 3.
    Bad,
}

impl Tone {
    fn style(self) -> Style {
        let color = match self {
            Self::Good => AnsiColor::Green,
            Self::Doubtful => AnsiColor::Yellow,
            Self::Bad => AnsiColor::Red,
        };
        color.on_default().bold()
    }
}

/// What a command leaves.
#[derive(Debug, Clone)]
pub(crate) struct Done {
    text: String,
    /// What `--quiet` leaves of it; all of what another program reads.
    short: Option<String>,
    /// Of what is judged; the first line says it.
    tone: Option<Tone>,
}

/// What another program reads.
impl From<String> for Done {
    fn from(text: String) -> Self {
        let (short, tone) = (None, None);
        Self { text, short, tone }
    }
}

impl Done {
    /// What a person reads.
    pub(crate) fn words(text: String) -> Self {
        let short = Some(String::new());
        Self { short, ..text.into() }
    }

    /// The same with what `--quiet` leaves of words.
    pub(crate) fn in_short(self, text: String) -> Self {
        let short = self.short.map(|_| text);
        Self { short, ..self }
    }

    /// The same, its first line a verdict.
    pub(crate) fn judged(self, tone: Tone) -> Self {
        let first = self.text.lines().next().unwrap_or_default().to_owned();
        let tone = Some(tone);
        Self { tone, ..self }.in_short(first)
    }

    pub(crate) fn exit_code(&self) -> u8 {
        match self.tone {
            Some(Tone::Bad) => 3,
            _ => 0,
        }
    }

    /// Prints it, whole or in short.
    ///
    /// # Errors
    /// What the system says about standard output.
    pub(crate) fn print(&self, quiet: bool) -> std::io::Result<()> {
        let Some(short) = &self.short else {
            let mut out = std::io::stdout().lock();
            return writeln!(out, "{}", self.text.trim_end()).and_then(|()| out.flush());
        };
        let text = if quiet { short } else { &self.text }.trim_end();
        if text.is_empty() {
            return Ok(());
        }
        let style = self.tone.map_or(Style::new(), Tone::style);
        let (first, rest) = text.split_at(text.find('\n').unwrap_or(text.len()));
        let mut out = anstream::stdout().lock();
        writeln!(out, "{style}{first}{style:#}{rest}").and_then(|()| out.flush())
    }
}
