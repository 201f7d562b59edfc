//! Pictures of point spread functions.

mod mosaic;
mod mosaic_page;

pub use mosaic::{MosaicPlan, PsfMosaic};
pub use mosaic_page::{PsfFormat, psf_mosaic, psf_page, write_psfs};
