//! Image sensors and the processing of their frames: irradiance to electrons, volts, digital numbers and pictures.
//!
//! Irradiance is W m⁻² nm⁻¹, and absolute: nothing is rescaled. Row 0 is the top of the picture.
//!
//! This crate knows nothing of lenses or scenes: it takes spectral irradiance from anywhere.
//!
#![doc = include_str!("../README.md")]

mod acuity;
mod angular_response;
mod as_read;
mod balance;
mod bench;
mod binning;
mod blur;
mod both_gains;
mod burst;
mod capture;
mod cfa;
mod chart;
mod chart_find;
mod check;
mod collect;
mod color;
mod defects;
mod demosaic;
mod denoise;
mod disparity;
mod dng;
mod error;
mod exit_pupil;
mod exposure;
mod files;
mod flat_field;
mod frames;
mod hdr;
mod highlights;
mod integrate;
mod interleaved;
mod least_squares;
mod lens_tables;
mod library;
mod local_tone;
mod metering;
mod motion;
mod noise;
mod optical_black;
mod optical_filter;
mod perspective;
mod phases;
mod photodiodes;
mod photon_transfer;
mod picture;
mod pixel_stack;
mod plane_rows;
mod points;
mod poisson;
mod process;
mod profile;
mod raw;
mod readout;
mod regions;
mod response;
mod rolling;
mod ron_file;
mod sampling;
mod scielab;
mod sensor;
mod sfr;
mod shading;
mod sharpen;
mod similarity;
mod space;
mod speed;
mod split;
mod texture;
mod tile_cosine;
mod tone;
mod uniformity;
mod white_light;

/// Planes and cubes of this crate are arrays of it.
pub use ndarray;

pub use acuity::Viewing;
pub use angular_response::{AngularResponse, PixelLight};
pub use balance::WhiteBalance;
pub use bench::{Bench, BenchSeries, BenchSettings};
pub use binning::{Binning, BinningKind, ReadLines};
pub use both_gains::GainRead;
pub use capture::Capture;
pub use cfa::{Bayer, Cfa, Tile};
pub use chart::ChartReport;
pub use chart_find::{ChartCorners, find_chart};
pub use collect::Illumination;
pub use color::{ColorCorrection, ColorMatrix};
pub use demosaic::{Demosaic, demosaic};
pub use disparity::{DisparityAxis, DisparityMap, DisparitySearch};
pub use dng::{
    ColorMap, DngBlack, DngColor, DngDetails, DngFile, DngLight, DngLook, DngNoise, DngOpcodes, DngProfile, DngReading,
    DngRendering, DngShot, GainTableMap, MaskedSamples, OwnMosaic, ProfileFile, raw_format_by_name, raw_format_of,
};
pub use error::SensorError;
pub use exit_pupil::ExitPupil;
pub use exposure::{AutoExposure, Exposure, ExposureControl, GainMode, Metering};
pub use files::Depth;
pub use frames::{ElectronRate, Electrons, Volts};
pub use highlights::Highlights;
pub use interleaved::Interleaved;
pub use lens_tables::{Displacement, FrameTable, LensCorrections, LensTables};
pub use local_tone::LocalTone;
pub use motion::Moved;
pub use noise::{Noise, NoiseSource, NoiseSources};
pub use optical_filter::OpticalFilter;
pub use perspective::Perspective;
pub use photon_transfer::{DarkCurrentEstimate, FlatPoint, Linearity, PhotonTransfer};
pub use picture::Picture;
pub use pixel_stack::{
    Interfaces, Microlens, MicrolensOutline, MicrolensPower, MicrolensShift, PixelStack, QuantumEfficiencyOf,
    StackLayer,
};
pub use points::{PointWindow, find_points};
pub use process::{Developed, LinearPicture, Processing};
pub use raw::{Levels, MaskedPixels, MergedFrame, Raw, RawPlane};
pub use response::{Adc, Response};
pub use rolling::{ImagePlace, RollingShutter};
pub use scielab::{scielab_delta_e, visual_snr};
pub use sensor::{
    BlackClamp, DarkCurrent, Defects, Filter, HighGain, Layer, OpticalBlack, Sensor, SplitPixel, TelegraphNoise,
};
pub use sfr::{EdgeResponse, find_edge, find_edges};
pub use shading::{LensShading, ShadingMap};
pub use similarity::{psnr_db, ssim};
pub use space::ColorSpace;
pub use texture::{TextureNoise, TextureResponse, TextureSpectra};
pub use tone::{Brightness, ToneCurve};
pub use uniformity::{FrameStack, NonUniformity, Parts, Spectrogram};
