//! The table's own consistency, and what is refused.

use super::*;

#[test]
fn every_default_passes_its_own_check_and_names_are_unique() {
    let mut names: Vec<_> = SPECS.iter().map(|s| s.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), SPECS.len());
    for spec in SPECS {
        assert!(spec.check(&spec.default.value()).is_ok(), "{}", spec.name);
        if let (Kind::Choice { choices, available }, Default::Text(text)) = (spec.kind, spec.default) {
            assert!(available.contains(&text) && available.iter().all(|a| choices.contains(a)), "{}", spec.name);
        }
    }
}

#[test]
fn refuses_unknown_names_ranges_and_what_is_not_there_yet() {
    let error = |name, value| Settings::new([(name, value)]).unwrap_err().to_string();
    assert!(error("ligth_samples", Value::Int(4)).contains("ligth_samples"));
    assert!(error("light_samples", Value::Int(0)).contains("1 to 4096"));
    assert!(error("supersample", Value::Int(3)).contains("[1, 2, 4]"));
    assert!(error("indirect", Value::Text("magic".into())).contains("final-gather"));
    assert!(error("target_error", Value::Float(0.01)).contains("not available yet"));
    assert!(error("depth_threshold", Value::Float(-1.0)).contains("from 0"));
    assert!(error("seed", Value::None).contains("whole numbers"));
    assert!(Settings::new([("seed", Value::Int(7))]).is_ok());
    let settings = Settings::new([("depth_threshold", Value::None), ("normal_threshold", Value::Int(1))]);
    let thresholds = settings.map(|s| (s.float("depth_threshold"), s.float("normal_threshold")));
    assert_eq!(thresholds.ok(), Some((None, Some(1.0))));
}
