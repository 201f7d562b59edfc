//! The numbers of fields (TIFF 6.0, TIFF/EP, DNG 1.4, Exif 2.32) and of some of their values.

pub(super) const NEW_SUBFILE_TYPE: u16 = 254;
pub(super) const IMAGE_WIDTH: u16 = 256;
pub(super) const IMAGE_LENGTH: u16 = 257;
pub(super) const BITS_PER_SAMPLE: u16 = 258;
pub(super) const COMPRESSION: u16 = 259;
pub(super) const PHOTOMETRIC_INTERPRETATION: u16 = 262;
pub(super) const IMAGE_DESCRIPTION: u16 = 270;
pub(super) const MAKE: u16 = 271;
pub(super) const MODEL: u16 = 272;
pub(super) const ORIENTATION: u16 = 274;
pub(super) const SAMPLES_PER_PIXEL: u16 = 277;
pub(super) const ROWS_PER_STRIP: u16 = 278;
pub(super) const X_RESOLUTION: u16 = 282;
pub(super) const Y_RESOLUTION: u16 = 283;
pub(super) const PLANAR_CONFIGURATION: u16 = 284;
pub(super) const RESOLUTION_UNIT: u16 = 296;
pub(super) const SOFTWARE: u16 = 305;
pub(super) const SUB_DIRECTORIES: u16 = 330;
pub(super) const CFA_REPEAT_PATTERN_DIM: u16 = 33421;
pub(super) const CFA_PATTERN: u16 = 33422;
pub(super) const EXIF_DIRECTORY: u16 = 34665;
pub(super) const DNG_VERSION: u16 = 50706;
pub(super) const DNG_BACKWARD_VERSION: u16 = 50707;
pub(super) const UNIQUE_CAMERA_MODEL: u16 = 50708;
pub(super) const CFA_PLANE_COLOR: u16 = 50710;
pub(super) const CFA_LAYOUT: u16 = 50711;
pub(super) const LINEARIZATION_TABLE: u16 = 50712;
pub(super) const BLACK_LEVEL: u16 = 50714;
pub(super) const WHITE_LEVEL: u16 = 50717;
pub(super) const COLOR_MATRIX_1: u16 = 50721;
pub(super) const COLOR_MATRIX_2: u16 = 50722;
pub(super) const AS_SHOT_NEUTRAL: u16 = 50728;
pub(super) const CALIBRATION_ILLUMINANT_1: u16 = 50778;
pub(super) const CALIBRATION_ILLUMINANT_2: u16 = 50779;
pub(super) const FORWARD_MATRIX_1: u16 = 50964;
pub(super) const FORWARD_MATRIX_2: u16 = 50965;
pub(super) const OPCODE_LIST_3: u16 = 51022;
pub(super) const NOISE_PROFILE: u16 = 51041;

/// Fields of the Exif directory (Exif 2.32).
pub(super) const EXPOSURE_TIME: u16 = 33434;
pub(super) const F_NUMBER: u16 = 33437;
pub(super) const PHOTOGRAPHIC_SENSITIVITY: u16 = 34855;
pub(super) const EXIF_VERSION: u16 = 36864;
pub(super) const FOCAL_LENGTH: u16 = 37386;
pub(super) const FOCAL_PLANE_X_RESOLUTION: u16 = 41486;
pub(super) const FOCAL_PLANE_Y_RESOLUTION: u16 = 41487;
pub(super) const FOCAL_PLANE_RESOLUTION_UNIT: u16 = 41488;
/// A value of it.
pub(super) const PER_CENTIMETER: u16 = 3;
pub(super) const LENS_MODEL: u16 = 42036;

/// Values of the tag `PhotometricInterpretation`.
pub(super) const RGB: u16 = 2;
pub(super) const COLOR_FILTER_ARRAY: u16 = 32803;
pub(super) const LINEAR_RAW: u16 = 34892;
/// Values of the calibration illuminants (EXIF light sources).
pub(super) const STANDARD_LIGHT_A: u16 = 17;
pub(super) const D65: u16 = 21;

/// The value of the tag `Make` in frames of this program.
pub(super) const OWN_MAKE: &str = "dioptric";

/// Fields that are read alone.
pub(super) const TILE_WIDTH: u16 = 322;
pub(super) const TILE_LENGTH: u16 = 323;
pub(super) const TILE_OFFSETS: u16 = 324;
pub(super) const TILE_BYTE_COUNTS: u16 = 325;
pub(super) const PREDICTOR: u16 = 317;
pub(super) const SAMPLE_FORMAT: u16 = 339;
pub(super) const BLACK_LEVEL_REPEAT_DIM: u16 = 50713;
pub(super) const BLACK_LEVEL_DELTA_H: u16 = 50715;
pub(super) const BLACK_LEVEL_DELTA_V: u16 = 50716;
pub(super) const DEFAULT_SCALE: u16 = 50718;
pub(super) const DEFAULT_CROP_ORIGIN: u16 = 50719;
pub(super) const DEFAULT_CROP_SIZE: u16 = 50720;
pub(super) const CAMERA_CALIBRATION_1: u16 = 50723;
pub(super) const CAMERA_CALIBRATION_2: u16 = 50724;
pub(super) const ANALOG_BALANCE: u16 = 50727;
pub(super) const AS_SHOT_WHITE_XY: u16 = 50729;
pub(super) const BASELINE_EXPOSURE: u16 = 50730;
pub(super) const ACTIVE_AREA: u16 = 50829;
pub(super) const MASKED_AREAS: u16 = 50830;
pub(super) const SUB_TILE_BLOCK_SIZE: u16 = 50974;
pub(super) const ROW_INTERLEAVE_FACTOR: u16 = 50975;
pub(super) const OPCODE_LIST_1: u16 = 51008;
pub(super) const OPCODE_LIST_2: u16 = 51009;
pub(super) const COLUMN_INTERLEAVE_FACTOR: u16 = 52547;
pub(super) const STRIP_OFFSETS: u16 = 273;
pub(super) const STRIP_BYTE_COUNTS: u16 = 279;

/// Fields of DNG 1.6 for the third calibration light, and what lights are.
pub(super) const CALIBRATION_ILLUMINANT_3: u16 = 52529;
pub(super) const CAMERA_CALIBRATION_3: u16 = 52530;
pub(super) const COLOR_MATRIX_3: u16 = 52531;
pub(super) const FORWARD_MATRIX_3: u16 = 52532;
pub(super) const ILLUMINANT_DATA_1: u16 = 52533;
pub(super) const ILLUMINANT_DATA_2: u16 = 52534;
pub(super) const ILLUMINANT_DATA_3: u16 = 52535;

/// Fields of a profile's look.
pub(super) const PROFILE_HUE_SAT_MAP_DIMS: u16 = 50937;
pub(super) const PROFILE_HUE_SAT_MAP_DATA_1: u16 = 50938;
pub(super) const PROFILE_HUE_SAT_MAP_DATA_2: u16 = 50939;
pub(super) const PROFILE_TONE_CURVE: u16 = 50940;
pub(super) const PROFILE_LOOK_TABLE_DIMS: u16 = 50981;
pub(super) const PROFILE_LOOK_TABLE_DATA: u16 = 50982;
pub(super) const PROFILE_HUE_SAT_MAP_ENCODING: u16 = 51107;
pub(super) const PROFILE_LOOK_TABLE_ENCODING: u16 = 51108;
pub(super) const BASELINE_EXPOSURE_OFFSET: u16 = 51109;
pub(super) const PROFILE_HUE_SAT_MAP_DATA_3: u16 = 52537;
/// Whose calibrations of cameras a profile goes with, and the camera that it is for.
pub(super) const CAMERA_CALIBRATION_SIGNATURE: u16 = 50931;
pub(super) const PROFILE_CALIBRATION_SIGNATURE: u16 = 50932;
pub(super) const PROFILE_NAME: u16 = 50936;
/// Local gains.
pub(super) const PROFILE_GAIN_TABLE_MAP: u16 = 52525;
/// Those of it that are noted.
pub(super) const PROFILE_GAIN_TABLE_MAP_2: u16 = 52544;
pub(super) const RGB_TABLES: u16 = 52543;
