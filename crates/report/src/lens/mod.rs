//! Lenses drawn, and the plots and the page of an analysis by real rays.

mod comparison;
mod drawing;
mod glass_map;
mod html;
mod maps;
mod page;

pub use comparison::LensComparisonPage;
pub use drawing::LensDrawing;
pub use html::LensPage;
pub use page::AnalysisPlots;
