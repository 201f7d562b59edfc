//! Lenses drawn, and the plots and the page of an analysis by real rays.

mod drawing;
mod html;
mod maps;
mod page;

pub use drawing::LensDrawing;
pub use page::AnalysisPlots;
