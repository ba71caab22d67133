//! How much a finding matters, and what it is about.

use super::{Finding, Paths, Severity};

impl Finding {
    /// How much it matters.
    pub fn severity(&self) -> Severity {
        match self {
            Self::NothingHeldOut
            | Self::NoController
            | Self::CrestFactor { .. }
            | Self::ReferenceIsInput { .. }
            | Self::Trend { .. }
            | Self::FewGoodLines { .. } => Severity::Note,
            Self::HeldSamples { wrong, .. } if !wrong => Severity::Note,
            Self::PeriodDrifts { grave, .. } if !grave => Severity::Warning,
            // Less may be a sensor of the log that is not the controller's.
            Self::ControllerMismatch {
                percent,
                factors: None,
                ..
            } if *percent < 100.0 => Severity::Warning,
            Self::HeldSamples { .. }
            | Self::CounterWraps { .. }
            | Self::PositionJumps { .. }
            | Self::LostSamples { .. }
            | Self::DoubleSamples { .. }
            | Self::OtherRate { .. }
            | Self::ControllerMismatch { .. }
            | Self::FeedbackOnly { .. }
            | Self::PeriodDrifts { .. }
            | Self::CommandSaturates { .. }
            | Self::RecordStandsApart { .. }
            | Self::RecordsDisagree { .. }
            | Self::HeldOutCopy { .. }
            | Self::PositionStandsApart { .. } => Severity::Contradiction,
            _ => Severity::Warning,
        }
    }

    /// The record or position that it is about; empty for the whole bundle.
    pub fn place(&self) -> &str {
        match self {
            Self::LowSignal { place, .. }
            | Self::ResponseIsNoise { place, .. }
            | Self::FewPeriods { place, .. }
            | Self::LongTransient { place, .. }
            | Self::DependentInputs { place, .. }
            | Self::BiasedLoop { place }
            | Self::Distortion { place, .. }
            | Self::FewGoodLines { place, .. }
            | Self::RecordsDisagree { place, .. } => place,
            Self::CrestFactor { record, .. }
            | Self::NearNyquist { record, .. }
            | Self::CoarseSensor { record, .. }
            | Self::Unexplained { record, .. }
            | Self::HeldSamples { record, .. }
            | Self::CounterWraps { record, .. }
            | Self::PositionJumps { record, .. }
            | Self::LostSamples { record, .. }
            | Self::DoubleSamples { record, .. }
            | Self::OtherRate { record, .. }
            | Self::ControllerMismatch { record, .. }
            | Self::FeedbackOnly { record, .. }
            | Self::PeriodDrifts { record, .. }
            | Self::LevelDrifts { record, .. }
            | Self::CommandSaturates { record, .. }
            | Self::ReferenceIsInput { record, .. }
            | Self::DeadTime { record, .. }
            | Self::Trend { record, .. }
            | Self::RecordStandsApart { record, .. }
            | Self::HeldOutCopy { record, .. }
            | Self::LevelDiffers { record, .. }
            | Self::PositionStandsApart { record, .. } => record,
            Self::NothingHeldOut
            | Self::NoController
            | Self::OnePosition
            | Self::BeyondPositions { .. }
            | Self::PositionGap { .. } => "",
        }
    }

    /// The column that it is about, where there is one.
    pub fn column(&self) -> Option<&str> {
        match self {
            Self::CrestFactor { column, .. }
            | Self::NearNyquist { column, .. }
            | Self::CoarseSensor { column, .. }
            | Self::HeldSamples { column, .. }
            | Self::CounterWraps { column, .. }
            | Self::PositionJumps { column, .. }
            | Self::LostSamples { column, .. }
            | Self::DoubleSamples { column, .. }
            | Self::OtherRate { column, .. }
            | Self::ControllerMismatch { column, .. }
            | Self::PeriodDrifts { column, .. }
            | Self::LevelDrifts { column, .. }
            | Self::CommandSaturates { column, .. }
            | Self::ReferenceIsInput { column, .. }
            | Self::DeadTime { column, .. }
            | Self::Trend { column, .. }
            | Self::LevelDiffers { column, .. }
            | Self::RecordStandsApart { column, .. } => Some(column),
            _ => None,
        }
    }
}

impl std::fmt::Display for Paths {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let reference = self.reference.unwrap_or(self.output);
        let alike = (reference / self.output - 1.0).abs() < 0.1;
        match alike {
            true => write!(f, "with {:.4} times its gain it would fit", self.output),
            false => write!(
                f,
                "it would fit with {:.4} times the output and {reference:.4} times the reference: check the sign of feedback_numerator and the units of y and r",
                self.output
            ),
        }
    }
}
