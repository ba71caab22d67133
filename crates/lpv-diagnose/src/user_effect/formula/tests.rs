use super::*;

#[test]
fn values_by_hand() {
    let (x, v) = (0.7_f64, -1.3_f64);
    let cases: [(&str, f64); 22] = [
        ("-x^2", -x * x),
        ("(-x)^2", x * x),
        ("2^3^2", 512.0),
        ("2**3*x", 8.0 * x),
        ("x^-2", 1.0 / (x * x)),
        ("x^0.5", x.sqrt()),
        ("x^v", x.powf(v)),
        ("1 - 2 - 3", -4.0),
        ("8/4/2", 1.0),
        ("8/4*2", 4.0),
        ("2*-x", -2.0 * x),
        ("--x + +v", x + v),
        ("1e-3*x", 1e-3 * x),
        ("1.5E2", 150.0),
        (".5*v", 0.5 * v),
        ("2*x - 3", 2.0 * x - 3.0),
        ("sin(x)^2 + cos(x)^2", 1.0),
        ("-exp(-(x/2)^2)", -(-(x / 2.0) * (x / 2.0)).exp()),
        ("min(x, v) + max(x, v)", x + v),
        ("atan2(v, x)", v.atan2(x)),
        ("abs(v)*signum(v)", v),
        (" ( pi ) ", std::f64::consts::PI),
    ];
    for (text, value) in cases {
        let formula = Formula::parse(text).unwrap();
        let found = formula.at(|i| match formula.names()[i].as_str() {
            "x" => x,
            "v" => v,
            other => panic!("{other}"),
        });
        assert!(
            (found - value).abs() <= 4e-16 * value.abs(),
            "{text} is {value}, not {found}"
        );
    }
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    for (text, part) in [
        ("", "ends where a value is expected"),
        ("-a*(x", "`)` is missing at character 6"),
        ("a + ", "ends where"),
        ("a $ b", "`$` is not expected at character 3"),
        ("2x", "`x` is not expected at character 2"),
        ("a b", "`b` is not expected at character 3"),
        ("sin x", "`(` is missing behind `sin`"),
        ("sine(x)", "`sine` is no function"),
        ("min(a)", "has two values"),
        ("sin(a, b)", "`)` is missing"),
        ("é*x", "`é` is not expected at character 1"),
        ("1.2.3", "`.` is not expected"),
        (".", "`.` is no number"),
        ("()", "`)` is not expected"),
    ] {
        let said = Formula::parse(text).unwrap_err();
        assert!(said.contains(part), "{text}: {part} in {said}");
    }
    assert!(
        Formula::parse(&format!("x{}", "+x".repeat(1500)))
            .unwrap_err()
            .contains("longer")
    );
    let nested = format!("{}x{}", "x*(".repeat(40), ")".repeat(40));
    assert!(Formula::parse(&nested).unwrap_err().contains("nested"));
    assert!(Formula::parse(&"(".repeat(2000)).is_err());
}
