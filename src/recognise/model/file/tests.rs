use super::*;

fn read(phases: &str) -> Result<ActionModel, Error> {
    let text = format!("schema = 1\nname = \"a\"\n{phases}");
    parse(&text, "a.toml", &Bands::default(), &none_to_mirror)
}

fn refused(phases: &str) -> String {
    read(phases).expect_err(phases).to_string()
}

/// Table 3 of Salamah and Brunnett 2016.
const KICK_R: &str = r#"
[[phase]]
name = "forward"
motion = "dynamic"
space = "in_place"
posture = "standing"
root = { frontal = "fixed", vertical = "fixed", sagittal = "fixed" }
left_foot = { frontal = "fixed", vertical = "fixed", sagittal = "fixed" }
right_foot = { frontal = "forward long fast", vertical = "up mean fast", sagittal = "fixed" }

[[phase]]
name = "back"
motion = "dynamic"
space = "in_place"
posture = "standing"
root = { frontal = "fixed", vertical = "fixed", sagittal = "fixed" }
left_foot = { frontal = "fixed", vertical = "fixed", sagittal = "fixed" }
right_foot = { frontal = "backward long fast", vertical = "down mean fast", sagittal = "fixed" }
"#;

#[test]
fn table_3_of_the_paper_is_written_as_it_stands() {
    let model = read(KICK_R).expect("a model");
    assert_eq!((model.phases.len(), model.leading), (2, 0));
    let forward = &model.phases[0];
    // Dynamic, not locomotive, and nine motions.
    assert_eq!(forward.gates.len(), 11);
    let far = forward.travels.iter().find(|of| of.feature.name() == "right_foot_frontal");
    let far = far.expect("the foot");
    assert_eq!((far.sign, far.amount.from, far.speed.from), (1.0, 0.6, 1.5));
    assert!(!forward.travels[1].amount.holds(0.6) && forward.travels[1].amount.holds(0.25));
    assert_eq!(model.phases[1].travels[0].sign, -1.0);
}

#[test]
fn in_a_mirror_the_other_foot_kicks_and_left_is_right() {
    let mut text = KICK_R.to_owned();
    text =
        text.replace("mean fast\", sagittal = \"fixed\"", "mean fast\", sagittal = \"left short\"");
    let mirrored = read(&text).expect("a model").mirrored();
    let names: BTreeSet<String> =
        mirrored.phases[0].travels.iter().map(|travel| travel.feature.name()).collect();
    assert!(names.iter().all(|name| name.starts_with("left_foot")), "{names:?}");
    let side = mirrored.phases[0].travels.iter().find(|of| of.feature.name().ends_with("sagittal"));
    assert_eq!(side.expect("sideways").sign, -1.0);
    assert_eq!(mirrored.mirrored(), read(&text).expect("a model"));
}

#[test]
fn what_is_not_known_is_refused_with_what_is() {
    for (phases, words) in [
        ("[[phase]]\nname = \"p\"\nposture = \"standig\"", ["no such posture", "standing"]),
        (
            "[[phase]]\nname = \"p\"\nmeasure.left_hand_hight = [0, 1]",
            ["no such feature", "left_hand_height"],
        ),
        ("[[phase]]\nname = \"p\"\nroot = { frontal = \"up\" }", ["root.frontal", "backward"]),
        ("[[phase]]\nname = \"p\"\nroot = { frontal = \"forward far\" }", ["far", "mean..long"]),
        ("[[phase]]\nname = \"p\"\nminor = [\"leaned\"]", ["minor", "in no capture"]),
        ("[[phase]]\nname = \"p\"\nspace = \"away\"", ["space", "in_place"]),
        ("[[phase]]\nname = \"p\"\ncolour = 1", ["line 5", "colour"]),
    ] {
        let said = refused(phases);
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
}

#[test]
fn a_phase_that_cannot_happen_is_refused() {
    for (keys, why) in [
        ("measure.hips_height = [1.0, 0.5]", "hips_height"),
        ("contact = [\"left_foot\"]\nno_contact = [\"left_foot\"]", "left_foot_contact"),
        ("minor = [\"upright\", \"bent\"]", "upright"),
        ("duration_s = [1.0, 0.5]", "0.5 s long"),
        ("root = { frontal = \"forward long slow\" }\nduration_s = [0.1, 0.5]", "root_frontal"),
        ("posture = \"lying\"\nminor = [\"upright\"]", "lying, and upright"),
        ("motion = \"static\"\nroot = { vertical = \"up long\" }", "static"),
        ("contact = [\"left_foot\"]\nmeasure.flight = [1, 1]", "in flight"),
        ("measure.feet_apart = [0.1, 0.2]\naverage.feet_apart = [0.3, 0.4]", "on average"),
        ("measure.feet_apart = [nan, 0.2]", "feet_apart"),
    ] {
        let said = refused(&format!("[[phase]]\nname = \"p\"\n{keys}"));
        assert!(said.contains("cannot happen") && said.contains(why), "{said}");
        assert!(said.contains("a.toml, phase p"), "{said}");
    }
    assert!(read("").is_err(), "no phase at all");
}

#[test]
fn leading_phases_lead_to_the_next_one_and_never_in_a_circle() {
    let phase = |name: &str, lead: &str| {
        let lead = if lead.is_empty() { String::new() } else { format!("lead = \"{lead}\"\n") };
        format!("[[phase]]\nname = \"{name}\"\n{lead}motion = \"dynamic\"\n")
    };
    let phases = |list: &[(&str, &str)]| -> String {
        list.iter().map(|(name, lead)| phase(name, lead)).collect()
    };
    let model = read(&phases(&[("a", "b"), ("b", "c"), ("c", "")])).expect("a model");
    assert_eq!(model.leading, 2);
    let circle = refused(&phases(&[("a", "b"), ("b", "a"), ("c", "")]));
    assert!(circle.contains("circle") && circle.contains("a -> b -> a"), "{circle}");
    assert!(refused(&phases(&[("a", "a"), ("b", "")])).contains("circle"));
    assert!(refused(&phases(&[("a", "x"), ("b", "")])).contains("not there"));
    assert!(refused(&phases(&[("a", "c"), ("b", ""), ("c", "")])).contains("right before"));
    assert!(refused(&phases(&[("a", ""), ("a", "")])).contains("one name"));
}

#[test]
fn a_model_of_a_version_to_come_or_of_a_wild_name_is_refused() {
    let read =
        |text: &str| parse(text, "a.toml", &Bands::default(), &none_to_mirror).expect_err(text);
    assert!(read("schema = 2\nname = \"a\"").to_string().contains("schema = 1"));
    assert!(read("schema = 1\nname = \"../a\"").to_string().contains("hyphens"));
    assert!(read("schema = 1\nname = \"a\"\nmirror_of = \"b\"").to_string().contains("mirror"));
    assert!(read(&" ".repeat(MAX_BYTES + 1)).to_string().contains("too long"));
}

#[test]
fn amounts_and_speeds_are_said_in_words_or_in_limb_lengths() {
    let travel = |words: &str| {
        let phase = format!("[[phase]]\nname = \"p\"\nroot = {{ frontal = \"{words}\" }}");
        let travel = read(&phase).expect(words).phases[0].travels[0];
        [travel.amount.from, travel.amount.to, travel.speed.from, travel.speed.to]
    };
    let most = f64::INFINITY;
    assert_eq!(travel("forward 0.3..0.5 1../s"), [0.3, 0.5, 1.0, most]);
    assert_eq!(travel("backward ..0.5"), [0.0, 0.5, -most, most]);
    assert_eq!(travel("forward mean..long fast"), [0.25, most, 1.5, most]);
    assert_eq!(travel("forward mean.. ..2/s"), [0.25, most, 0.0, 2.0]);
    assert!(
        refused("[[phase]]\nname = \"p\"\nroot = { frontal = \"forward 3/x\" }").contains("3/x")
    );
}

#[test]
fn a_phase_says_in_one_of_two_words_when_it_is_over() {
    let ends = |words: &str| {
        let phase = format!("[[phase]]\nname = \"p\"\nposture = \"sitting\"\n{words}");
        read(&phase).map(|model| model.phases[0].ends_soon).map_err(|error| error.to_string())
    };
    assert_eq!(ends(""), Ok(false));
    assert_eq!(ends("ends = \"late\""), Ok(false));
    assert_eq!(ends("ends = \"soon\""), Ok(true));
    let said = ends("ends = \"now\"").expect_err("no such word");
    assert!(said.contains("a.toml, phase p, ends") && said.contains("soon, late"), "{said}");
}
