//! What the parser of the command line refuses, in one sentence of ours: the option, what was given, and what is expected.

use std::{error::Error as _, num};

use clap::{
    Command,
    error::{ContextKind, ContextValue, ErrorKind},
};
use dioptric_pipeline::range_of;

/// Returns the sentence for what was refused, or nothing where help or the version was asked for.
pub(crate) fn sentence(words: &Command, error: &clap::Error) -> Option<String> {
    if !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return None;
    }
    let given = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => vec![text.clone()],
        Some(ContextValue::Strings(texts)) => texts.clone(),
        Some(ContextValue::StyledStr(text)) => vec![text.to_string()],
        Some(ContextValue::StyledStrs(texts)) => texts.iter().map(ToString::to_string).collect(),
        _ => Vec::new(),
    };
    let first = |kind| given(kind).into_iter().next().unwrap_or_default();
    let argument = first(ContextKind::InvalidArg);
    let (option, value) = (name_of(&argument), first(ContextKind::InvalidValue));
    let usage = first(ContextKind::Usage).trim_start_matches("Usage: ").to_owned();
    let is_word = |word: &&str| !word.starts_with(['-', '<', '[']);
    let command = usage.split(' ').take_while(is_word).collect::<Vec<_>>().join(" ");
    let listed = |kind| Some(given(kind)).filter(|values| !values.is_empty()).map(|values| either(&values));
    Some(match error.kind() {
        ErrorKind::InvalidValue if value.is_empty() => {
            let value_name = argument.split_once(' ').map_or("a value", |(_, name)| name);
            let expected = listed(ContextKind::ValidValue).or_else(|| range(option)).unwrap_or(value_name.to_owned());
            format!("{option} lacks its value, expected {expected}")
        }
        ErrorKind::InvalidValue => {
            format!("{option} is '{value}', expected {}", listed(ContextKind::ValidValue).unwrap_or_default())
        }
        ErrorKind::ValueValidation => format!("{option} is '{value}'{}", reason(error, option, &value)),
        ErrorKind::ArgumentConflict => {
            let others: Vec<_> = given(ContextKind::PriorArg).iter().map(|other| name_of(other).to_owned()).collect();
            match others.as_slice() {
                [other] if other == option => format!("{option} is given twice: leave out one of the two"),
                [other] => format!("{option} does not go with {other}: leave out one of the two"),
                others => {
                    format!("{option} does not go with {}: leave out the one or the others", others.join(" and "))
                }
            }
        }
        ErrorKind::UnknownArgument if argument.starts_with('-') => {
            let similar = listed(ContextKind::SuggestedArg).map(|similar| format!("similar is {similar}, and "));
            let similar = similar.unwrap_or_default();
            format!("{argument} is no option of '{command}': {similar}'{command} --help' lists all")
        }
        ErrorKind::UnknownArgument => format!("'{argument}' is one word too many, expected {usage}"),
        ErrorKind::InvalidSubcommand => {
            let wrong = first(ContextKind::InvalidSubcommand);
            let known = command.split(' ').skip(1).try_fold(words, |of, name| of.find_subcommand(name));
            let names = known.unwrap_or(words).get_subcommands().map(Command::get_name).filter(|name| *name != "help");
            let expected = either(&names.map(ToOwned::to_owned).collect::<Vec<_>>());
            format!("'{wrong}' is no command of '{command}', expected {expected}")
        }
        ErrorKind::MissingRequiredArgument => {
            let missing = given(ContextKind::InvalidArg);
            format!(
                "{} {} missing, expected {usage}",
                missing.join(" and "),
                if missing.len() > 1 { "are" } else { "is" }
            )
        }
        ErrorKind::TooManyValues => format!("{option} takes no value, but was given '{value}'"),
        // Seldom: a word that is no text.
        _ => error.to_string().lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned(),
    })
}

/// Returns the name of an argument that may have the names of its values behind it.
fn name_of(argument: &str) -> &str {
    argument.split([' ', '=']).next().unwrap_or(argument)
}

/// Returns the range of the numbers of an option, if it has one.
fn range(option: &str) -> Option<String> {
    range_of(&option.trim_start_matches('-').replace('-', "_")).map(ToString::to_string)
}

/// Returns why a value cannot be read, from the words of who reads it, which need not say again what was given.
fn reason(error: &clap::Error, option: &str, value: &str) -> String {
    let Some(source) = error.source() else { return String::new() };
    let number = |number: &str| format!(", expected {}", range(option).unwrap_or(number.to_owned()));
    if source.is::<num::ParseFloatError>() {
        return number("a number");
    }
    let text = source.to_string();
    if source.is::<num::ParseIntError>() || text.contains("expected one of: ") {
        return number("a whole number, 0 or more");
    }
    if let Some((_, bounds)) = text.split_once(" is not in ") {
        let (least, most) = bounds.split_once("..=").unwrap_or((bounds, ""));
        return number(&format!("a whole number from {least} to {most}"));
    }
    match text.split_once("expected ") {
        Some((before, expected)) if before.is_empty() || before.contains(&format!("'{value}'")) => {
            format!(", expected {expected}")
        }
        _ => format!(": {text}"),
    }
}

/// Returns a list of choices in words.
fn either(choices: &[String]) -> String {
    match choices {
        [most @ .., last] if !most.is_empty() => format!("{} or {last}", most.join(", ")),
        _ => choices.concat(),
    }
}

#[cfg(test)]
mod tests {
    use clap::{Arg, ArgAction};

    use super::*;
    use crate::args::Cli;

    fn said(line: &[String]) -> String {
        let error = Cli::words().try_get_matches_from(line).unwrap_err();
        sentence(&Cli::words(), &error).unwrap_or_default()
    }

    /// Walks all options of all commands.
    fn each(command: &Command, path: &[String], told: &mut impl FnMut(&[String], &Arg)) {
        command.get_arguments().for_each(|argument| told(path, argument));
        for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
            each(inner, &[path, &[inner.get_name().to_owned()]].concat(), told);
        }
    }

    /// Every option of every command with a value that none can be: one sentence with the option, the value, and what is expected.
    #[test]
    fn every_bad_value_is_named_with_what_is_expected() {
        let (mut wrong, mut n_told) = (Vec::new(), 0);
        let words = Cli::words();
        let mut check = |line: &[String], parts: &[&str]| {
            let Err(error) = words.clone().try_get_matches_from(line) else { return };
            // Whether the value is any good is asked by who reads it then.
            if error.kind() == ErrorKind::MissingRequiredArgument {
                return;
            }
            let text = sentence(&words, &error).unwrap_or_default();
            n_told += 1;
            if parts.iter().any(|part| part.starts_with('\'') && text.matches(part).count() > 1)
                || text.contains('\n')
                || text.contains("error: ")
                || !parts.iter().all(|part| text.contains(part))
            {
                wrong.push(format!("{line:?}: {text}"));
            }
        };
        each(&words, &["dioptric".to_owned()], &mut |path, argument| {
            let Some(long) = argument.get_long().filter(|long| !["help", "version"].contains(long)) else { return };
            let option = format!("--{long}");
            if matches!(argument.get_action(), ArgAction::SetTrue) {
                check(&[path, &[format!("{option}=3")]].concat(), &[&option, "'3'", "takes no value"]);
                return;
            }
            for value in ["?odd?", "-1", "nonesuch:9:x"] {
                let line = [path, &[format!("{option}={value}")]].concat();
                check(&line, &[&option, &format!("'{value}'"), "expected"]);
            }
            check(&[path, std::slice::from_ref(&option)].concat(), &[&option, "lacks its value, expected"]);
            check(&[path, &[format!("{option}xyzzy=3")]].concat(), &[&option, "is no option of", "--help"]);
        });
        assert!(wrong.is_empty() && n_told > 500, "{n_told}: {wrong:#?}");
    }

    /// Every pair of options of every command: where the two do not go together, both are named.
    #[test]
    fn every_conflict_names_both() {
        let mut n_told = 0;
        let words = Cli::words();
        each(&words.clone(), &["dioptric".to_owned()], &mut |path, argument| {
            let Some(command) = path.iter().skip(1).try_fold(&words, |of, name| of.find_subcommand(name)) else {
                return;
            };
            let own: Vec<_> = command.get_arguments().map(Arg::get_id).cloned().collect();
            for other in
                command.get_arg_conflicts_with(argument).into_iter().filter(|other| own.contains(other.get_id()))
            {
                let (Some(one), Some(two)) = (argument.get_long(), other.get_long()) else { continue };
                let word = |arg: &Arg, long: &str| match arg.get_action() {
                    ArgAction::SetTrue => format!("--{long}"),
                    _ => match arg.get_possible_values().first() {
                        Some(value) => format!("--{long}={}", value.get_name()),
                        None => format!("--{long}=1,1,1,1"),
                    },
                };
                let text = said(&[path, &[word(argument, one), word(other, two)]].concat());
                if text.contains("does not go with") {
                    n_told += 1;
                    assert!(text.contains(&format!("--{one}")) && text.contains("leave out"), "{text}");
                }
            }
        });
        assert!(n_told > 10, "{n_told}");
    }

    #[test]
    fn sentences_read_as_one() {
        for (line, expected) in [
            ("run --fov-deg x", "--fov-deg is 'x', expected 0.001 to 179 degrees"),
            (
                "run --width-mm 3 --distance-mm 2 --fov-deg 4",
                "--width-mm does not go with --fov-deg: leave out one of the two",
            ),
            ("run --quality best", "--quality is 'best', expected sketch, preview, draft or full"),
            ("run --threads 0", "--threads is '0', expected a whole number from 1 to 4294967295"),
            ("run --seed -1", "--seed is '-1', expected a whole number, 0 or more"),
            ("run --fov-deg 3 --fov-deg 4", "--fov-deg is given twice: leave out one of the two"),
            ("run a.ron b.ron", "'b.ron' is one word too many, expected dioptric run [OPTIONS] [CAMERA]"),
            ("scene inf", "'inf' is no command of 'dioptric scene', expected info or convert"),
            ("scene info", "<FILE> is missing, expected dioptric scene info <FILE>"),
            (
                "scene info a.png --depth-kind disparity:-0.1",
                "--depth-kind is 'disparity:-0.1': the baseline of the disparity is -0.1: expected a finite number above 0",
            ),
        ] {
            let line: Vec<_> = ["dioptric"].into_iter().chain(line.split(' ')).map(str::to_owned).collect();
            assert_eq!(said(&line), expected);
        }
    }
}
