//! The words that say of a scene's file what it does not say itself.

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use dioptric_pipeline::{
    DepthKind, FileQuantity, FileReading, NoData, Panorama, PipelineError, SceneSpec, parse_numbers,
};

/// What a scene's file does not state.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Scene file")]
pub(crate) struct SceneFileArgs {
    /// Depth of the scene, in place of one in its file or beside it: a gray picture, float TIFF, PFM, EXR or .npy
    #[arg(long, value_name = "FILE")]
    pub(crate) depth: Option<PathBuf>,
    /// What 1 of the depth's numbers is: mm, cm, m, or so many of them a metre, as 5000/m; of a disparity px or 256/px
    #[arg(long, value_name = "UNIT")]
    pub(crate) depth_unit: Option<String>,
    /// What the depth's numbers are: axial, radial, inverse, `inverse:NEAR_M,FAR_M` (the largest and the smallest number),
    /// `buffer:NEAR_M,FAR_M` (of a renderer, from 0 to 1), `ndc:NEAR_M,FAR_M` (from -1 to 1) or `disparity:BASELINE_M\[,OFFSET_PX\]`
    /// [default: axial]
    #[arg(long, value_name = "KIND")]
    pub(crate) depth_kind: Option<DepthKind>,
    /// Channel of an EXR file, or array of a MATLAB, HDF5 or .npz file, that holds the depth; number of one of several planes of a TIFF
    #[arg(long, value_name = "NAME")]
    pub(crate) depth_variable: Option<String>,
    /// Camera data of the scene: our JSON, `Open3D`'s, nerfstudio's, COLMAP's cameras.txt or `OpenCV`'s YAML
    #[arg(long, value_name = "FILE")]
    pub(crate) view: Option<PathBuf>,
    /// Picture of all directions: equirectangular or cube, of which the field of view straight ahead is seen, or that `:YAW,PITCH`
    /// degrees to the right and up
    #[arg(long, value_name = "KIND")]
    pub(crate) panorama: Option<Panorama>,
    /// What a cube's numbers are: radiance, reflectance or photons; reflectance of a picture: its colors are those of things under a light
    #[arg(long, value_name = "WHAT")]
    pub(crate) quantity: Option<FileQuantity>,
    /// Unit of a cube's numbers, as W/m^2/sr/nm, uW/(cm^2 sr nm) or photons/s/m^2/sr/nm
    #[arg(long, value_name = "UNIT")]
    pub(crate) unit: Option<String>,
    /// Factor on a cube's numbers
    #[arg(long, value_name = "F")]
    pub(crate) scale: Option<f64>,
    /// Number that a perfect white has in a cube that does not state it
    #[arg(long, value_name = "N")]
    pub(crate) white_level: Option<f64>,
    /// Center of each band of a file that does not state them, nm: a list or first:last:step
    #[arg(long, value_name = "LIST")]
    pub(crate) scene_wavelengths_nm: Option<String>,
    /// Variable of a MATLAB, HDF5 or .npz file that holds the cube; layer of an EXR file that holds the colors
    #[arg(long, value_name = "NAME")]
    pub(crate) variable: Option<String>,
    /// Order of the axes of an array: rows y, columns x and bands b, as yxb
    #[arg(long, value_name = "ORDER")]
    pub(crate) axes: Option<String>,
    /// What becomes of samples that are no light (no numbers, infinite, to be ignored): black, fill (the nearest of the row) or refuse;
    /// negative ones become 0, but for refuse [default: black]
    #[arg(long, value_name = "CHOICE")]
    pub(crate) no_data: Option<NoData>,
    /// Depth where none was measured: beside (the farther of those beside it), far (the farthest of the scene), or metres
    #[arg(long, value_name = "FILL")]
    pub(crate) fill_depth: Option<String>,
}

impl SceneFileArgs {
    /// Changes what a camera file says of the scene's file.
    pub(crate) fn change(&self, scene: &mut SceneSpec) -> anyhow::Result<()> {
        if let Some(fill) = &self.fill_depth {
            scene.fill_depth = Some(fill.parse().map_err(PipelineError::from)?);
        }
        scene.white_level = self.white_level.or(scene.white_level);
        let reading = &mut scene.reading;
        let own = std::mem::take(reading);
        let list = self.scene_wavelengths_nm.as_deref();
        *reading = FileReading {
            quantity: self.quantity.or(own.quantity),
            unit: self.unit.clone().or(own.unit),
            scale: self.scale.or(own.scale),
            wavelengths_nm: match list {
                Some(list) => Some(parse_numbers("--scene-wavelengths-nm", list)?),
                None => own.wavelengths_nm,
            },
            variable: self.variable.clone().or(own.variable),
            axes: self.axes.clone().or(own.axes),
            no_data: self.no_data.or(own.no_data),
            depth: self.depth.clone().or(own.depth),
            depth_unit: self.depth_unit.clone().or(own.depth_unit),
            depth_kind: self.depth_kind.or(own.depth_kind),
            depth_variable: self.depth_variable.clone().or(own.depth_variable),
            view: self.view.clone().or(own.view),
            panorama: self.panorama.or(own.panorama),
        };
        if reading.quantity == Some(FileQuantity::Reflectance) && reading.unit.is_some() {
            bail!("--unit is of light, expected it without --quantity reflectance");
        }
        Ok(())
    }
}
