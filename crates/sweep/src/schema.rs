//! What a plan may hold, as a template and as a JSON schema.

/// The schema of plan files, made from the types by `cargo xtask schema`; as that of camera files it describes RON as JSON.
pub const PLAN_SCHEMA: &str = include_str!("../data/plan.schema.json");
/// A plan with every way of varying in comments.
pub const PLAN_TEMPLATE: &str = include_str!("../data/template.ron");

/// Returns the schema as the types have it, with the name of its file.
#[cfg(feature = "schema")]
pub fn generated_schema() -> (&'static str, String) {
    ("plan.schema.json", format!("{:#}\n", schemars::schema_for!(crate::Plan).to_value()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Plan, Shard, Sweep};

    #[test]
    fn template_is_a_plan() {
        let plan = Plan::parse(PLAN_TEMPLATE, Path::new("template.ron")).unwrap();
        let sweep = Sweep::of(plan, Path::new("template.ron")).unwrap();
        assert_eq!((sweep.len(), sweep.n_irradiances(Shard::ALL)), (12, 3));
    }

    #[test]
    fn every_commented_way_is_one() {
        // Each line of the template that is commented out with two spaces is a way of varying.
        let ways: Vec<&str> = PLAN_TEMPLATE.lines().filter_map(|line| line.strip_prefix("        //  ")).collect();
        assert!(ways.len() >= 6, "{ways:?}");
        for way in ways {
            let text = format!("(base: Demo, vary: [{way}])");
            let plan = Plan::parse(&text, Path::new("way.ron")).unwrap();
            Sweep::of(plan, Path::new("way.ron")).unwrap();
        }
    }

    #[test]
    fn schema_names_every_word() {
        let schema: serde_json::Value = serde_json::from_str(PLAN_SCHEMA).unwrap();
        let keys: Vec<&String> = schema["properties"].as_object().unwrap().keys().collect();
        assert_eq!(keys, ["base", "keep", "outputs", "vary"]);
        for word in ["LatinHypercube", "LogUniform", "Sobol"] {
            assert!(PLAN_SCHEMA.contains(word) && PLAN_TEMPLATE.contains(word), "{word}");
        }
    }
}
