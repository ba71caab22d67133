//! A small fixed palette that colour-blind readers can tell apart.

/// The colour of a series, by role or by index.
///
/// Roles keep the figures of one report consistent: what was measured or is true is drawn in ink, the model in
/// blue. The hues are those of Okabe and Ito (2008), told apart under the common forms of colour blindness; on
/// a dark page each has a lighter twin.
///
/// | colour | light | dark |
/// |---|---|---|
/// | `Reference` | ink `#1b1b1b` | `#ececec` |
/// | `Model`, `Index(0)` | blue `#0072b2` | `#4aa8e0` |
/// | `Error`, `Index(1)` | vermilion `#d55e00` | `#f08a4b` |
/// | `Index(2)` | bluish green `#009e73` | `#2cc79c` |
/// | `Index(3)` | reddish purple `#b8578c` | `#e39cc6` |
/// | `Index(4)` | orange `#c98700` | `#f0b845` |
/// | `Index(5)` | sky blue `#3d9bd6` | `#8accf4` |
/// | `Bound` | grey `#7d7d7d` | `#9c9c9c` |
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Colour {
    /// What was measured, or the truth: ink.
    Reference,
    /// The model: blue.
    #[default]
    Model,
    /// A deviation: vermilion.
    Error,
    /// A bar, a limit, something in the background: grey.
    Bound,
    /// One of the six hues; larger indices start again from 0.
    Index(usize),
}

/// Light and dark value of each palette entry; the position is the number in the class names.
pub(crate) const PALETTE: [(&str, &str); 8] = [
    ("#1b1b1b", "#ececec"),
    ("#0072b2", "#4aa8e0"),
    ("#d55e00", "#f08a4b"),
    ("#009e73", "#2cc79c"),
    ("#b8578c", "#e39cc6"),
    ("#c98700", "#f0b845"),
    ("#3d9bd6", "#8accf4"),
    ("#7d7d7d", "#9c9c9c"),
];

impl Colour {
    /// Position in [`PALETTE`].
    pub(crate) fn slot(self) -> usize {
        match self {
            Colour::Reference => 0,
            Colour::Model => 1,
            Colour::Error => 2,
            Colour::Bound => 7,
            Colour::Index(index) => 1 + index % 6,
        }
    }

    /// The value on white paper.
    pub(crate) fn light(self) -> &'static str {
        PALETTE[self.slot()].0
    }
}

#[cfg(test)]
mod tests {
    use super::Colour;

    #[test]
    fn an_index_starts_again_and_never_meets_ink_or_grey() {
        assert_eq!(Colour::Index(0).slot(), Colour::Model.slot());
        assert_eq!(Colour::Index(6).slot(), Colour::Index(0).slot());
        for index in [0, 5, 7, 1000, usize::MAX] {
            let slot = Colour::Index(index).slot();
            assert!((1..=6).contains(&slot), "index {index} gives slot {slot}");
        }
    }
}
