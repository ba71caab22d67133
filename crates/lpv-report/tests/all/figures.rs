//! Figures from the outside: well-formed, small, the same twice, and never a panic.

use lpv_report::{Account, Axis, Colour, Figure, Legend, Marker, Panel, ReportError, Series, Share, Style};
use proptest::prelude::*;
use resvg::usvg::roxmltree::Document;

fn noise(index: usize) -> f64 {
    ((index as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(1.0) - 0.5
}

fn panel(points: Vec<(f64, f64)>) -> Panel {
    Panel::new(Axis::linear("x"), Axis::linear("y")).series(Series::line(points))
}

#[test]
fn a_figure_without_content_says_what_is_missing() {
    let error = Figure::new("Bode").to_svg().unwrap_err();
    assert!(matches!(&error, ReportError::EmptyFigure { figure } if figure == "Bode"));
    assert!(error.to_string().contains("Bode"), "{error}");
    let empty = Figure::new("F").panel(panel(vec![])).panel(Panel::default());
    assert!(matches!(
        empty.to_svg(),
        Err(ReportError::EmptyPanel { panel: 1, .. })
    ));
}

#[test]
fn settings_that_cannot_be_drawn_are_named() {
    let base = || Figure::new("F").panel(panel(vec![(0.0, 1.0), (1.0, 2.0)]));
    let with_x = |x: Axis| {
        let series = Series::line(vec![(0.0, 1.0), (1.0, 2.0)]);
        Figure::new("F")
            .panel(Panel::new(x, Axis::linear("")).series(series))
            .to_svg()
    };
    assert!(matches!(
        base().columns(0).to_svg(),
        Err(ReportError::Size { .. })
    ));
    assert!(matches!(
        base().width(f64::NAN).to_svg(),
        Err(ReportError::Size { .. })
    ));
    assert!(matches!(
        base().plot_height(1e9).to_svg(),
        Err(ReportError::Size { .. })
    ));
    assert!(matches!(
        with_x(Axis::linear("").range(2.0, 1.0)),
        Err(ReportError::AxisRange { axis: 'x', .. })
    ));
    assert!(matches!(
        with_x(Axis::log("").range(0.0, 1.0)),
        Err(ReportError::AxisRange { .. })
    ));
    assert!(matches!(
        with_x(Axis::linear("").step(1e-9)),
        Err(ReportError::TickStep { .. })
    ));
    assert!(matches!(
        with_x(Axis::linear("").step(f64::NAN)),
        Err(ReportError::TickStep { .. })
    ));
    let narrow = (0..8)
        .fold(Figure::new("F"), |f, _| f.panel(panel(vec![(0.0, 1.0)])))
        .columns(8)
        .width(300.0);
    assert!(matches!(
        narrow.to_svg(),
        Err(ReportError::TooNarrow { columns: 8, .. })
    ));
    let mixed = base().panel(Panel::new(Axis::log(""), Axis::linear("")).series(Series::line(vec![])));
    assert!(matches!(
        mixed.share(Share::X).to_svg(),
        Err(ReportError::SharedScale {
            panel: 1,
            axis: 'x',
            ..
        })
    ));
    let equal = Figure::new("F").panel(
        Panel::new(Axis::log(""), Axis::linear(""))
            .series(Series::line(vec![]))
            .equal_aspect(),
    );
    assert!(matches!(equal.to_svg(), Err(ReportError::EqualAspect { .. })));
    let band = Series::new(vec![(0.0, 1.0); 3], Style::Band { lower: vec![0.0; 2] });
    let band = Figure::new("F").panel(Panel::default().series(band));
    assert!(matches!(
        band.to_svg(),
        Err(ReportError::BandLength {
            points: 3,
            lower: 2,
            ..
        })
    ));
}

#[test]
fn points_without_a_place_are_counted() {
    let points = vec![
        (0.0, 1.0),
        (1.0, -1.0),
        (2.0, 0.0),
        (3.0, f64::NAN),
        (4.0, 1e300),
        (5.0, 10.0),
        (9.0, 1.0),
    ];
    let figure = Figure::new("F")
        .panel(Panel::new(Axis::linear("").range(0.0, 6.0), Axis::log("")).series(Series::line(points)));
    let account = figure.account().unwrap();
    let svg = figure.to_svg().unwrap();
    let expected = Account {
        points: 7,
        not_finite: 2,
        not_positive: 2,
        outside: 1,
        svg_bytes: svg.len(),
    };
    assert_eq!(account, expected);
    assert!(svg.contains("2 points ≤ 0 not shown"));
    let nothing = Figure::new("F")
        .panel(panel(vec![(f64::NAN, 1.0)]))
        .to_svg()
        .unwrap();
    assert!(nothing.contains("no point to show"));
}

#[test]
fn a_band_that_reaches_below_zero_is_drawn_on_a_logarithmic_axis() {
    let edges: Vec<_> = (0..50).map(|k| (f64::from(k), -0.1, 1.0)).collect();
    let figure =
        Figure::new("F").panel(Panel::new(Axis::linear(""), Axis::log("")).series(Series::band(&edges)));
    assert_eq!(figure.account().unwrap().not_positive, 0);
    assert!(figure.to_svg().unwrap().contains("fill-opacity"));
}

#[test]
fn noise_of_sixteen_thousand_points_stays_small_and_is_the_same_twice() {
    let figure = (0..4).fold(Figure::new("Noise").columns(2), |figure, p| {
        let panel = (0..4).fold(Panel::new(Axis::log("f"), Axis::log("|G|")), |panel, s| {
            let points = (1..=16_000)
                .map(|k| (f64::from(k), 10_f64.powf(6.0 * noise(k as usize * 5 + s + p))))
                .collect();
            panel.series(
                Series::line(points)
                    .colour(Colour::Index(s))
                    .label(format!("{s}")),
            )
        });
        figure.panel(panel)
    });
    let svg = figure.to_svg().unwrap();
    assert!(svg.len() < 150_000, "{} bytes", svg.len());
    assert_eq!(svg, figure.clone().to_svg().unwrap());
    assert_eq!(figure.to_png(600).unwrap(), figure.to_png(600).unwrap());
}

#[test]
fn clouds_and_scribbles_stay_small() {
    for style in [Style::Dots, Style::Crosses, Style::Circles, Style::Line] {
        let points = (0..16_000).map(|k| (noise(k), noise(k + 77_777))).collect();
        let figure = Figure::new("F").panel(Panel::default().series(Series::new(points, style.clone())));
        let bytes = figure.account().unwrap().svg_bytes;
        assert!(bytes < 150_000, "{style:?}: {bytes} bytes");
    }
}

#[test]
fn a_straight_line_lands_on_the_corners_of_its_plot() {
    let figure = Figure::new("").panel(
        Panel::new(Axis::linear("").range(0.0, 1.0), Axis::linear("").range(0.0, 1.0))
            .series(Series::line(vec![(0.0, 0.0), (0.25, 0.25), (1.0, 1.0)])),
    );
    let svg = figure.width(400.0).plot_height(200.0).to_svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    let clip = document
        .descendants()
        .find(|n| n.has_tag_name("clipPath"))
        .unwrap()
        .first_element_child()
        .unwrap();
    let width: f64 = clip.attribute("width").unwrap().parse().unwrap();
    let line = document
        .descendants()
        .find(|n| n.attribute("class") == Some("s1"))
        .unwrap();
    assert_eq!(line.attribute("d").unwrap(), format!("M0 200l{width}-200"));
}

#[test]
fn a_png_has_its_width_and_its_text() {
    let with = Figure::new("A title").panel(panel(vec![(0.0, 1.0), (1.0, 2.0)]));
    let png = with.to_png(500).unwrap();
    assert_eq!(&png[1..4], b"PNG");
    assert_eq!(u32::from_be_bytes([png[16], png[17], png[18], png[19]]), 500);
    let mut other = with.clone();
    other.title = "B title".to_owned();
    assert_ne!(png, other.to_png(500).unwrap(), "the title is drawn");
}

#[test]
fn text_is_escaped_and_the_legend_follows_its_setting() {
    let nasty = "</text><script>alert(1)</script>&\u{0}\"'";
    let series = Series::line(vec![(0.0, 1.0), (1.0, 2.0)]).label(nasty);
    let panel = Panel::new(Axis::linear(nasty), Axis::linear(nasty))
        .title(nasty)
        .series(series);
    let figure = Figure::new(nasty).panel(panel.marker(Marker::vertical(0.5).label(nasty)));
    let svg = figure.to_svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    assert!(!document.descendants().any(|n| n.has_tag_name("script")));
    let hidden = figure.legend(Legend::Hidden).to_svg().unwrap();
    assert!(hidden.len() < svg.len());
}

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>(),
        -10.0..10.0f64,
        Just(0.0),
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::MAX),
        Just(5e-324)
    ]
}

fn wild_style() -> impl Strategy<Value = Style> {
    prop_oneof![
        Just(Style::Line),
        Just(Style::Dashed),
        Just(Style::Dotted),
        Just(Style::DashDot),
        Just(Style::Dots),
        Just(Style::Circles),
        Just(Style::Crosses),
        prop::collection::vec(wild(), 0..12).prop_map(|lower| Style::Band { lower }),
    ]
}

fn wild_series() -> impl Strategy<Value = Series> {
    let colour = prop_oneof![Just(Colour::Reference), any::<usize>().prop_map(Colour::Index)];
    (
        prop::collection::vec((wild(), wild()), 0..12),
        wild_style(),
        colour,
        wild(),
        any::<Option<String>>(),
    )
        .prop_map(|(points, mut style, colour, width, label)| {
            if let Style::Band { lower } = &mut style
                && width > 0.0
            {
                lower.resize(points.len(), 0.5);
            }
            let mut series = Series::new(points, style).colour(colour).width(width);
            series.label = label;
            series
        })
}

fn wild_axis() -> impl Strategy<Value = Axis> {
    let range = prop_oneof![4 => Just(None), 1 => (wild(), wild()).prop_map(Some)];
    let step = prop_oneof![6 => Just(None), 1 => wild().prop_map(Some)];
    (any::<String>(), any::<bool>(), range, step).prop_map(|(label, log, range, step)| {
        let mut axis = if log {
            Axis::log(label)
        } else {
            Axis::linear(label)
        };
        axis.range = range;
        axis.step = step;
        axis
    })
}

fn wild_panel() -> impl Strategy<Value = Panel> {
    let place = (wild(), wild(), any::<String>()).prop_map(|(x, y, text)| {
        [
            Marker::vertical(x).label(text.clone()),
            Marker::horizontal(y).label(text.clone()),
            Marker::text(x, y, text),
        ]
    });
    let series = prop::collection::vec(wild_series(), 0..3);
    (
        wild_axis(),
        wild_axis(),
        series,
        prop::option::of(place),
        any::<bool>(),
    )
        .prop_map(|(x, y, series, markers, equal)| {
            let mut panel = Panel::new(x, y);
            panel.series = series;
            panel.markers = markers.into_iter().flatten().collect();
            if equal { panel.equal_aspect() } else { panel }
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn wild_figures_are_drawn_or_refused(
        title in any::<String>(),
        panels in prop::collection::vec(wild_panel(), 0..5),
        columns in 0usize..5,
        share in prop_oneof![4 => Just(Share::Nothing), 1 => Just(Share::X), 1 => Just(Share::Both)],
        width in prop_oneof![4 => Just(None), 1 => wild().prop_map(Some)],
    ) {
        let mut figure = Figure::new(title).columns(columns).share(share);
        figure.panels = panels;
        figure.width = width;
        match figure.to_svg() {
            Ok(svg) => {
                prop_assert!(Document::parse(&svg).is_ok());
                prop_assert!(!svg.contains("NaN") && !svg.contains("\"inf"), "a number that is none");
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }

    #[test]
    fn single_panels_of_any_data_are_always_drawn(
        points in prop::collection::vec((wild(), wild()), 1..20),
        log_x in any::<bool>(),
        log_y in any::<bool>(),
    ) {
        let axis = |log: bool| if log { Axis::log("") } else { Axis::linear("") };
        let panel = Panel::new(axis(log_x), axis(log_y))
            .series(Series::line(points.clone()))
            .series(Series::new(points, Style::Dots));
        let svg = Figure::new("F").panel(panel).to_svg();
        prop_assert!(svg.is_ok(), "{:?}", svg);
    }
}
