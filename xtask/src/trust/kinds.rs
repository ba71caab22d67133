//! The kinds of input that people have come with, each made anew with other numbers, and what is right for each.

mod axes;
mod clock;
mod formats;
mod inputs;
mod machines;
mod mat_files;
pub(crate) mod records;

pub(crate) use axes::{rigid_body, rubbed, servo, swings};

pub(crate) use super::draw::Draw;
pub(crate) use super::judge::{Judged, Words};
pub(crate) use super::program::Lab;
pub(crate) use crate::TaskError;
use experiment_data::Bundle;

type Make = fn(&mut Draw, &Lab) -> Result<Judged, TaskError>;

/// A kind of input.
pub(crate) struct Kind {
    /// Name, that of the folder it was first met in.
    pub(crate) name: &'static str,
    /// Makes one in a folder, runs the program and judges.
    pub(crate) make: Make,
    /// Whether its files hold rate, roles and positions, which `lpv new` is to find.
    pub(crate) is_for_new: bool,
}

const fn kind(name: &'static str, make: Make) -> Kind {
    Kind {
        name,
        make,
        is_for_new: false,
    }
}

const fn drafted(name: &'static str, make: Make) -> Kind {
    Kind {
        name,
        make,
        is_for_new: true,
    }
}

/// All of them.
pub(crate) const KINDS: [Kind; 40] = [
    kind("chirp-noise-free-command", clock::chirp_noise_free_command),
    kind("closed-loop-noise-only", clock::closed_loop_noise_only),
    kind("command-at-its-limit", inputs::command_at_its_limit),
    kind("controller-mismatch", records::controller_mismatch),
    drafted("csv-preambles", formats::csv_preambles),
    drafted("dspace-mat", mat_files::dspace_mat),
    drafted(
        "empty-cells-in-an-unused-column",
        formats::empty_cells_in_an_unused_column,
    ),
    kind("encoder-wrap", clock::encoder_wrap),
    kind("explained-false-alarm", inputs::explained_false_alarm),
    kind("free-shaft-cable", axes::free_shaft_cable),
    kind("gantry-undecoupled", machines::gantry_undecoupled),
    drafted("german-csv", formats::german_csv),
    kind("held-samples", clock::held_samples),
    kind(
        "inertia-three-times-too-small",
        axes::inertia_three_times_too_small,
    ),
    kind("lengths", machines::lengths),
    kind("lost-samples", clock::lost_samples),
    kind("many-modes", machines::many_modes),
    kind("mat-of-objects", mat_files::mat_of_objects),
    drafted("matlab-containers", mat_files::matlab_containers),
    drafted("matrix-mat", mat_files::matrix_mat),
    drafted("milliseconds", clock::milliseconds),
    kind("nine-positions-steps", machines::nine_positions_steps),
    kind("no-controller", axes::no_controller),
    kind("one-record-wrong", records::one_record_wrong),
    kind(
        "open-loop-machine-cannot-be-diagnosed",
        axes::open_loop_machine_cannot_be_diagnosed,
    ),
    kind("period-not-whole", clock::period_not_whole),
    kind("polarity", records::polarity),
    drafted("position-column-names", records::position_column_names),
    kind("reference-is-input", records::reference_is_input),
    kind("same-position-weak-record", records::same_position_weak_record),
    kind("saturated-command", inputs::saturated_command),
    drafted("scalars-outnumber-signals", mat_files::scalars_outnumber_signals),
    kind("segment-message", axes::segment_message),
    kind("sensor-drift", clock::sensor_drift),
    kind("servo-speed-output", axes::servo_speed_output),
    kind("transient-trend-and-delay", clock::transient_trend_and_delay),
    kind("two-encoder-stage-frf", machines::two_encoder_stage_frf),
    kind("unexcited-lines", inputs::unexcited_lines),
    kind(
        "unstable-model-without-a-word",
        inputs::unstable_model_without_a_word,
    ),
    kind("viscous-friction", machines::viscous_friction),
];

/// What `lpv new` drafted.
#[derive(Debug, Clone, Default)]
pub(crate) struct Draft {
    pub(crate) rate: f64,
    pub(crate) outputs: Vec<String>,
    pub(crate) inputs: Vec<String>,
    pub(crate) references: Vec<String>,
    pub(crate) scheduling: Vec<String>,
    whole: toml::Table,
}

/// Reads the draft of a folder; none where there is none.
pub(crate) fn draft(lab: &Lab, folder: &str) -> Option<Draft> {
    let text = std::fs::read_to_string(lab.path(folder).join("experiment.toml")).ok()?;
    let whole: toml::Table = text.parse().ok()?;
    let columns = |role: &str| -> Vec<String> {
        let listed = whole
            .get("channels")
            .and_then(|c| c.get(role))
            .and_then(|g| g.get("columns"));
        let names = listed.and_then(toml::Value::as_array).into_iter().flatten();
        names.filter_map(|v| v.as_str().map(str::to_owned)).collect()
    };
    let rate = whole.get("sample_rate");
    Some(Draft {
        rate: rate
            .and_then(|r| r.as_float().or(r.as_integer().map(|i| i as f64)))
            .unwrap_or(0.0),
        outputs: columns("output"),
        inputs: columns("input"),
        references: columns("reference"),
        scheduling: columns("scheduling"),
        whole,
    })
}

impl Draft {
    /// Whether these signals are among the columns that the draft knows, whatever it calls them and takes them for.
    pub(crate) fn holds(mut self, lab: &Lab, signals: &[&[f64]]) -> bool {
        let mut names = Vec::new();
        for group in ["output", "input", "reference", "scheduling", "auxiliary"] {
            let table = self
                .whole
                .get("channels")
                .and_then(|c| c.get(group))
                .and_then(|g| g.get("columns"));
            names.extend(table.and_then(toml::Value::as_array).cloned().unwrap_or_default());
        }
        if names.len() < signals.len().max(2) {
            return false;
        }
        let mut groups = toml::Table::new();
        let mut rest = names.split_off(2).into_iter();
        let mut put = |name: &str, columns: Vec<toml::Value>| {
            let mut table = toml::Table::new();
            table.insert("columns".to_owned(), toml::Value::Array(columns));
            groups.insert(name.to_owned(), toml::Value::Table(table));
        };
        put("input", names.split_off(1));
        put("output", names);
        put("auxiliary", rest.by_ref().collect());
        self.whole
            .insert("channels".to_owned(), toml::Value::Table(groups));
        if self.rate <= 0.0 {
            self.whole
                .insert("sample_rate".to_owned(), toml::Value::Float(1.0));
        }
        let records = self.whole.get_mut("records").and_then(toml::Value::as_array_mut);
        for record in records
            .into_iter()
            .flatten()
            .filter_map(toml::Value::as_table_mut)
        {
            record.insert("kind".to_owned(), toml::Value::String("transient".to_owned()));
            record.remove("period");
        }
        let file = lab.path("values.toml");
        if std::fs::write(&file, self.whole.to_string()).is_err() {
            return false;
        }
        let Ok(record) = Bundle::open(&file).and_then(|b| b.load(0)) else {
            return false;
        };
        let columns: Vec<&Vec<f64>> = [&record.outputs, &record.inputs, &record.auxiliary]
            .iter()
            .flat_map(|s| s.columns.iter())
            .collect();
        signals.iter().all(|wanted| {
            let size = wanted.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            columns.iter().any(|c| {
                c.len() == wanted.len() && c.iter().zip(*wanted).all(|(a, b)| (a - b).abs() <= 1e-6 * size)
            })
        })
    }
}
