//! Files of lenses and glasses: read, refused and written. One program, which is compiled and linked once.

mod absorption;
mod bench;
mod glass;
mod len;
mod more;
#[path = "../mutate/mod.rs"]
mod mutate;
mod placed;
mod robust;
mod seq;
mod seq_placed;
mod shared;
mod write;
mod write_seq;
mod zmx;
