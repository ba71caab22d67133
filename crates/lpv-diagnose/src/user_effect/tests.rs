use super::*;

fn effect(toml_like: impl FnOnce(&mut UserEffect)) -> UserEffect {
    let amplitude = UserParameter {
        unit: "u".to_owned(),
        ..UserParameter::default()
    };
    let mut effect = UserEffect {
        name: "of-my-own".to_owned(),
        meaning: String::new(),
        family: None,
        channel: None,
        force: Some("-a*x^3".to_owned()),
        reading: None,
        states: BTreeMap::new(),
        parameters: BTreeMap::from([("a".to_owned(), amplitude)]),
    };
    toml_like(&mut effect);
    effect
}

#[test]
fn what_is_wrong_is_said() {
    type Change = fn(&mut UserEffect);
    let parameter = |starts: &[f64], positive| UserParameter {
        starts: starts.to_vec(),
        positive,
        ..UserParameter::default()
    };
    let with = |name: &str, p: UserParameter| {
        effect(|e| {
            e.parameters.insert(name.to_owned(), p);
            e.force = Some(format!("a*{name}"));
        })
    };
    let cases: [(Change, &str); 12] = [
        (|e| e.name = "My effect".to_owned(), "small letters"),
        (
            |e| e.name = "cogging".to_owned(),
            "the catalogue has an effect of this name",
        ),
        (|e| e.force = None, "either `force`"),
        (|e| e.reading = Some("a".to_owned()), "either `force`"),
        (|e| e.parameters.clear(), "no parameter"),
        (
            |e| e.parameters.values_mut().for_each(|p| p.starts = vec![1.0]),
            "no amplitude",
        ),
        (|e| e.force = Some("-a*(x".to_owned()), "is no formula"),
        (|e| e.force = Some(String::new()), "is no formula"),
        (
            |e| e.force = Some("-a*z".to_owned()),
            "has `z`, which is none of t, x, v",
        ),
        (
            |e| e.force = Some("x".to_owned()),
            "no formula has its parameter `a`",
        ),
        (|e| e.force = Some("a*y".to_owned()), "not known to a force"),
        (
            |e| e.force = Some(format!("a{}", "+a".repeat(2000))),
            "longer than",
        ),
    ];
    let said = |e: &UserEffect| e.at(0, &[]).unwrap_err().to_string();
    for (change, part) in cases {
        let text = said(&effect(change));
        assert!(text.contains(part), "{part} in {text}");
    }
    for (name, p, part) in [
        ("x", parameter(&[], false), "means something else"),
        ("sin", parameter(&[], false), "means something else"),
        ("2w", parameter(&[], false), "is no name in a formula"),
        ("w", parameter(&[0.0], true), "must be above zero"),
        ("w", parameter(&[f64::NAN], false), "must be finite"),
        ("w", parameter(&[1.0; 257], false), "257 starts"),
    ] {
        let text = said(&with(name, p));
        assert!(text.contains(part), "{part} in {text}");
    }
    let rate = |rate: &str| {
        effect(|e| {
            let state = UserState {
                rate: rate.to_owned(),
                start: 0.0,
            };
            e.states.insert("z".to_owned(), state);
            e.force = Some("a*z".to_owned());
        })
    };
    assert!(said(&rate("y")).contains("not known to the rate"));
    assert!(rate("v - abs(v)*z/0.1").at(0, &[]).is_ok());
}

/// Whatever is written, the answer is an effect or a refusal.
#[test]
fn no_text_panics() {
    let parts = [
        "a", "x", "(", ")", "+", "-", "*", "/", "^", "sin", " ", "1e", ".", "{", "}", "min", "é", "\"", "e",
        "PI", ",", "1", "$",
    ];
    let mut seed = 1_u64;
    let mut refused = 0;
    for _ in 0..20_000 {
        let mut text = String::new();
        seed = seed
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        for i in 0..(seed >> 60) {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(i);
            text += parts[(seed >> 33) as usize % parts.len()];
        }
        let law = Law::of(&effect(|e| e.force = Some(text)), &[]);
        refused += usize::from(law.is_err());
    }
    assert!(refused > 10_000 && refused < 20_000, "{refused}");
}

#[test]
fn one_definition_is_one_effect_and_is_known_again() {
    let own = effect(|e| e.name = "known-again".to_owned());
    let one = own.at(0, &[]).unwrap();
    assert!(std::ptr::eq(one, own.at(0, &[]).unwrap()));
    assert!(!std::ptr::eq(one, own.at(1, &[]).unwrap()));
    assert_eq!(UserEffect::behind(one), Some(own));
    assert_eq!(catalogue::all().find_map(UserEffect::behind), None);
}
