//! Options from the raw frame to the picture, made from the table of choices.

use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches, value_parser};
use dioptric_pipeline::{PICTURE, PictureOptions};

/// From the raw frame to the picture.
#[derive(Debug, Default)]
pub(crate) struct PictureArgs(pub(crate) PictureOptions);

impl Args for PictureArgs {
    fn augment_args(command: Command) -> Command {
        PICTURE.iter().fold(command, |command, key| {
            let arg = Arg::new(key.name).long(key.option).value_name(key.value).help(key.help);
            let arg = arg.help_heading("Exposure and picture");
            command.arg(if key.is_number() { arg.value_parser(value_parser!(f64)) } else { arg })
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for PictureArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let mut read = Self::default();
        read.update_from_arg_matches(matches)?;
        Ok(read)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        for key in &PICTURE {
            let word = match key.is_number() {
                true => matches.get_one(key.name).map(f64::to_string),
                false => matches.get_one(key.name).cloned(),
            };
            if let Some(word) = word {
                self.0.choose(key, word);
            }
        }
        Ok(())
    }
}
