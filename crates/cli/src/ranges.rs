//! Numbers of the command line, held to their ranges before any work.

use anyhow::bail;
use clap::{ArgMatches, Command};
use dioptric_pipeline::{parse_directions, parse_numbers, range_of};

/// Checks every number that was given, or each of a list, against the range of its option.
///
/// # Errors
/// Names the first that is beyond its range, and the range.
pub(crate) fn check(command: &Command, matches: &ArgMatches) -> anyhow::Result<()> {
    for argument in command.get_arguments() {
        let id = argument.get_id().as_str();
        let Some(range) = range_of(id) else { continue };
        if let Some(wrong) = numbers(matches, id).into_iter().find(|number| !range.holds(*number)) {
            bail!("--{} is {wrong}, expected {range}", argument.get_long().unwrap_or(id));
        }
    }
    match matches.subcommand() {
        Some((name, matches)) => command.find_subcommand(name).map_or(Ok(()), |command| check(command, matches)),
        None => Ok(()),
    }
}

/// Returns the numbers that an option was given; none of words, which their readers know.
fn numbers(matches: &ArgMatches, id: &str) -> Vec<f64> {
    if let Ok(Some(values)) = matches.try_get_many::<f64>(id) {
        return values.copied().collect();
    }
    if let Ok(Some(values)) = matches.try_get_many::<usize>(id) {
        return values.map(|n| *n as f64).collect();
    }
    if let Ok(Some(values)) = matches.try_get_many::<u32>(id) {
        return values.map(|n| f64::from(*n)).collect();
    }
    let Ok(Some(lists)) = matches.try_get_many::<String>(id) else { return Vec::new() };
    let pairs = |list: &str| parse_directions("a list", list).unwrap_or_default().into_flattened();
    lists.flat_map(|list| parse_numbers("a list", list).unwrap_or_else(|_| pairs(list))).collect()
}

#[cfg(test)]
mod tests {
    use std::any::TypeId;

    use super::*;
    use crate::args::Cli;

    /// Options whose numbers have no range of their own.
    const FREE: [&str; 3] = ["seed", "limit", "threads"];

    fn without_range(command: &Command, found: &mut Vec<String>) {
        for argument in command.get_arguments() {
            let id = argument.get_id().as_str();
            let kind = argument.get_value_parser().type_id();
            let is_number =
                [TypeId::of::<f64>(), TypeId::of::<usize>(), TypeId::of::<u32>()].iter().any(|of| kind == *of);
            if is_number && range_of(id).is_none() && !FREE.contains(&id) {
                found.push(format!("{} --{id}", command.get_name()));
            }
        }
        command.get_subcommands().for_each(|command| without_range(command, found));
    }

    #[test]
    fn every_number_has_a_range() {
        let mut found = Vec::new();
        without_range(&Cli::words(), &mut found);
        assert!(found.is_empty(), "{found:?}");
    }

    #[track_caller]
    fn said(line: &str) -> Option<String> {
        let matches = Cli::words().try_get_matches_from(line.split(' ')).unwrap();
        check(&Cli::words(), &matches).err().map(|error| error.to_string())
    }

    #[test]
    fn values_may_begin_as_negative_numbers_do() {
        for line in [
            "scene convert a.png b.exr --depth-unit -1000/m --fill-depth -1 --unit -W --variable -1",
            "scene info a.hdr --scale -2 --scene-wavelengths-nm -400,500 --white-level -1",
            "render a.pbrt --eye -1,0,2 --look-at 0,-1,0 -o out",
            "run --scene a.exr --focus-mm -5 --illuminant -3K",
        ] {
            let read = Cli::words().try_get_matches_from(["dioptric"].into_iter().chain(line.split(' ')));
            assert!(read.is_ok(), "{line}: {}", read.unwrap_err());
        }
        // A file is no number, and what follows it is an option.
        let line = "dioptric scene info a.hdr --depth --scale 2";
        assert!(Cli::words().try_get_matches_from(line.split(' ')).is_err());
    }

    #[test]
    fn what_is_beyond_a_range_is_named() {
        assert_eq!(
            said("dioptric run --fov-deg 20 --noise all --bracket-stops -4,-2,0 --wavelengths-nm 400:700:10"),
            None
        );
        assert_eq!(said("dioptric psf a.ron --distances-mm 2000,inf --fields-deg 0,5/10"), None);
        for (line, expected) in [
            ("dioptric run --fov-deg 1e-9", "--fov-deg is 0.000000001, expected 0.001 to 179 degrees"),
            ("dioptric run --sharpen-px -1", "--sharpen-px is -1, expected 0 to 2 pixels"),
            ("dioptric psf a.ron --distances-mm 2000,-5", "--distances-mm is -5, expected 1e-6 to 1e12 mm, or inf"),
            ("dioptric lens draw a.ron -o a.svg --fields-deg 500", "--fields-deg is 500, expected -180 to 180 degrees"),
            ("dioptric psf a.ron --size 1000000", "--size is 1000000, expected 1 to 8192 pixels"),
        ] {
            assert_eq!(said(line).as_deref(), Some(expected), "{line}");
        }
    }
}
