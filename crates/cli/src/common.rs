//! Options of every command.

use clap::Args;
use dioptric_pipeline::parse_bytes;

/// Options of every command.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Every command")]
pub(crate) struct Common {
    /// Prints numbers as JSON
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Memory that the program may take, as 1GiB or 500MB: what does not fit goes through files or is refused [default: half of the machine's]
    #[arg(long, global = true, value_name = "BYTES", value_parser = parse_bytes)]
    pub(crate) memory: Option<u64>,
    /// Uses N threads, at most 4 per core [default: 1 per core]; results do not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) threads: Option<u32>,
    /// Draws all noise from this seed [default: the camera file's, or 1]
    #[arg(long, global = true, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Prints nothing but errors and what was asked for
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
}
