//! Reading a dataset folder; every fault of every file is collected before giving up.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use super::geodetic;
use super::meta::Meta;
use super::{
    Dataset, DatasetError, HeadingRow, ImuBias, ImuRow, Odometry, Odometry2dRow, Odometry3dRow,
    PositionRow, Truth, Truth2dRow, TruthRow, VelocityRow,
};
use crate::table::read::{CsvTable, RowReader};
use crate::table::{Fault, Faults};

/// The file names to read, for folders that hold alternatives (`position_noisy.csv`,
/// `reference.csv`).
///
/// ```
/// use inekf_client::dataset::LoadOptions;
///
/// // A folder that holds noisier fixes beside the good ones.
/// let noisy = LoadOptions { position_file: "position_noisy.csv".to_owned(), ..LoadOptions::default() };
/// assert_eq!(noisy.truth_file, "truth.csv");
/// ```
#[derive(Clone, Debug)]
pub struct LoadOptions {
    /// Position fixes; default `position.csv`.
    pub position_file: String,
    /// Truth; default `truth.csv`.
    pub truth_file: String,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            position_file: "position.csv".to_owned(),
            truth_file: "truth.csv".to_owned(),
        }
    }
}

impl Dataset {
    /// Reads a dataset folder.
    ///
    /// ```
    /// use inekf_client::dataset::Dataset;
    ///
    /// let folder = tempfile::tempdir()?;
    /// std::fs::write(folder.path().join("meta.json"), r#"{"name": "bench"}"#)?;
    /// std::fs::write(folder.path().join("imu.csv"), "t_ns,gx,gy,gz,ax,ay,az\n10,0,0,0.1,0,0,9.81\n")?;
    /// let dataset = Dataset::load(folder.path())?;
    /// assert_eq!(dataset.imu[0].gyro_rps, [0.0, 0.0, 0.1]);
    /// // A fault names file, line and column.
    /// std::fs::write(folder.path().join("imu.csv"), "t_ns,gx,gy,gz,ax,ay,az\n10,0,0,fast,0,0,9.81\n")?;
    /// assert!(Dataset::load(folder.path()).unwrap_err().to_string().contains("fast"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// See [`Dataset::load_with`].
    pub fn load(dir: impl AsRef<Path>) -> Result<Self, DatasetError> {
        Self::load_with(dir, &LoadOptions::default())
    }

    /// Reads a dataset folder with other file names for positions or truth; a file that is named
    /// there but is not the default has to exist.
    ///
    /// # Errors
    /// [`DatasetError::Folder`] if there is no such folder, [`DatasetError::File`] if a file cannot
    /// be opened, [`DatasetError::Faults`] with every fault of every file.
    ///
    /// ```
    /// use inekf_client::dataset::{Dataset, LoadOptions};
    ///
    /// let folder = tempfile::tempdir()?;
    /// std::fs::write(folder.path().join("meta.json"), r#"{"name": "bench"}"#)?;
    /// std::fs::write(folder.path().join("imu.csv"), "t_ns,gx,gy,gz,ax,ay,az\n10,0,0,0.1,0,0,9.81\n")?;
    /// // A file that is named has to exist.
    /// let options = LoadOptions { position_file: "rtk.csv".to_owned(), ..LoadOptions::default() };
    /// let error = Dataset::load_with(folder.path(), &options).expect_err("no rtk.csv");
    /// assert!(error.to_string().contains("rtk.csv"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn load_with(dir: impl AsRef<Path>, options: &LoadOptions) -> Result<Self, DatasetError> {
        let dir = dir.as_ref();
        fs::read_dir(dir).map_err(|cause| DatasetError::Folder {
            path: dir.to_owned(),
            cause,
        })?;
        let mut folder = Folder {
            dir,
            faults: Faults::new(),
        };
        let defaults = LoadOptions::default();
        folder.require_if_chosen(&options.position_file, &defaults.position_file);
        folder.require_if_chosen(&options.truth_file, &defaults.truth_file);

        let mut meta = folder.meta()?;
        let mut frame = geodetic::frame_of(&meta, &mut folder.faults);
        // In the order in which faults are listed.
        let imu = folder.table("imu.csv", IMU, read_imu)?.unwrap_or_default();
        let odometry = folder
            .table("odometry.csv", ODOMETRY_2D, read_odometry)?
            .unwrap_or_default();
        let position = folder
            .table(&options.position_file, POSITION, |table, faults| {
                if table.has("lat") {
                    geodetic::read_position(table, &mut frame, faults)
                } else {
                    read_position(table, faults)
                }
            })?
            .unwrap_or_default();
        if let Some(frame) = frame {
            geodetic::note_frame(&mut meta, &frame);
        }
        let mut dataset = Self {
            meta,
            imu,
            odometry,
            position,
            velocity: folder
                .table("velocity.csv", VELOCITY, read_velocity)?
                .unwrap_or_default(),
            heading: folder
                .table("heading.csv", HEADING, read_heading)?
                .unwrap_or_default(),
            truth: folder
                .table(&options.truth_file, TRUTH, read_truth_table)?
                .unwrap_or_default(),
        };
        folder.require_motion(&dataset);
        if folder.faults.is_empty() {
            dataset.sort();
            Ok(dataset)
        } else {
            Err(DatasetError::Faults {
                path: dir.to_owned(),
                faults: folder.faults,
            })
        }
    }
}

/// Reads one truth file by itself (`truth.csv`, `reference.csv`).
///
/// ```
/// use inekf_client::dataset::{Truth, read_truth};
///
/// let file = tempfile::NamedTempFile::new()?;
/// std::fs::write(file.path(), "t_ns,theta,x,y\n10,0.5,1,2\n")?;
/// let Truth::Planar(rows) = read_truth(file.path())? else { panic!("it is of the plane") };
/// assert_eq!(rows[0].p_w_m, [1.0, 2.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`DatasetError::File`] if it cannot be opened, [`DatasetError::Faults`] with every fault found.
pub fn read_truth(path: impl AsRef<Path>) -> Result<Truth, DatasetError> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|cause| DatasetError::File {
        path: path.to_owned(),
        cause,
    })?;
    let name = path
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut faults = Faults::new();
    let truth = CsvTable::open(&name, BufReader::new(file), TRUTH, &mut faults)
        .map(|table| read_truth_table(table, &mut faults))
        .unwrap_or_default();
    if faults.is_empty() {
        Ok(truth)
    } else {
        Err(DatasetError::Faults {
            path: path.to_owned(),
            faults,
        })
    }
}

/// A folder being read, with the faults found so far.
struct Folder<'a> {
    dir: &'a Path,
    faults: Faults,
}

pub(super) type Table = CsvTable<BufReader<File>>;

impl Folder<'_> {
    fn path(&self, file: &str) -> PathBuf {
        self.dir.join(file)
    }

    fn open(&self, file: &str) -> Result<Option<File>, DatasetError> {
        let path = self.path(file);
        match File::open(&path) {
            Ok(file) => Ok(Some(file)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(cause) => Err(DatasetError::File { path, cause }),
        }
    }

    /// Reads a table if its file is there.
    fn table<T>(
        &mut self,
        file: &str,
        example: &str,
        read: impl FnOnce(Table, &mut Faults) -> T,
    ) -> Result<Option<T>, DatasetError> {
        let Some(input) = self.open(file)? else {
            return Ok(None);
        };
        let table = CsvTable::open(file, BufReader::new(input), example, &mut self.faults);
        Ok(table.map(|table| read(table, &mut self.faults)))
    }

    /// `meta.json`, or what follows from the folder's name if there is none.
    fn meta(&mut self) -> Result<Meta, DatasetError> {
        let name = self
            .dir
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let path = self.path("meta.json");
        match fs::read_to_string(&path) {
            Ok(text) => Ok(Meta::parse(&text, &mut self.faults)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Meta {
                name,
                ..Meta::default()
            }),
            Err(cause) => Err(DatasetError::File { path, cause }),
        }
    }

    fn require_if_chosen(&mut self, file: &str, default: &str) {
        if file != default && !self.path(file).exists() {
            let problem = "the file is not there";
            self.faults.push(Fault::in_file(
                file,
                problem,
                format!("leave the option out to read {default}"),
            ));
        }
    }

    /// A dataset needs IMU samples or odometry increments.
    fn require_motion(&mut self, dataset: &Dataset) {
        let has_odometry = match &dataset.odometry {
            Odometry::None => false,
            Odometry::Planar(rows) => !rows.is_empty(),
            Odometry::Spatial(rows) => !rows.is_empty(),
        };
        if !dataset.imu.is_empty() || has_odometry || self.faults.count_in("imu.csv") > 0 {
            return;
        }
        if self.faults.count_in("odometry.csv") > 0 {
            return;
        }
        let (imu, odometry) = (
            self.path("imu.csv").exists(),
            self.path("odometry.csv").exists(),
        );
        let (file, problem) = match (imu, odometry) {
            (false, false) => ("imu.csv", "neither imu.csv nor odometry.csv is there"),
            (true, _) => ("imu.csv", "no rows under the header"),
            (false, true) => ("odometry.csv", "no rows under the header"),
        };
        let remedy =
            format!("imu.csv has the columns {IMU}, odometry.csv {ODOMETRY_2D} or {ODOMETRY_3D}");
        self.faults.push(Fault::in_file(file, problem, remedy));
    }
}

pub(super) const IMU: &str = "t_ns,gx,gy,gz,ax,ay,az";
pub(super) const ODOMETRY_2D: &str = "t_ns,dtheta,dx,dy";
pub(super) const ODOMETRY_3D: &str = "t_ns,rx,ry,rz,dx,dy,dz";
const POSITION: &str = "t_ns,x,y,z,sx,sy,sz";
const VELOCITY: &str = "t_ns,vx,vy,vz,sx,sy,sz";
const HEADING: &str = "t_ns,heading,sigma";
const TRUTH: &str = "t_ns,qw,qx,qy,qz,vx,vy,vz,x,y,z";
const TRUTH_2D: &str = "t_ns,theta,x,y";

const GYRO_BIAS: [&str; 3] = ["bgx", "bgy", "bgz"];
const ACCEL_BIAS: [&str; 3] = ["bax", "bay", "baz"];

/// Reads all rows if the columns named in `header` are there.
pub(super) fn read_rows<T>(
    table: Table,
    header: &str,
    faults: &mut Faults,
    parse: impl FnMut(&mut RowReader<'_>) -> Option<T>,
) -> Vec<T> {
    let columns: Vec<&str> = header.split(',').collect();
    if table.require(&columns, faults) {
        table.rows(faults, parse)
    } else {
        Vec::new()
    }
}

fn read_imu(table: Table, faults: &mut Faults) -> Vec<ImuRow> {
    let mut last = None;
    read_rows(table, IMU, faults, |row| {
        let stamp_ns = row.stamp_after("t_ns", &mut last);
        let gyro_rps = row.numbers(["gx", "gy", "gz"]);
        let accel_mps2 = row.numbers(["ax", "ay", "az"]);
        Some(ImuRow {
            stamp_ns: stamp_ns?,
            gyro_rps: gyro_rps?,
            accel_mps2: accel_mps2?,
        })
    })
}

fn read_odometry(table: Table, faults: &mut Faults) -> Odometry {
    let mut last = None;
    if table.has("rx") || table.has("dz") {
        Odometry::Spatial(read_rows(table, ODOMETRY_3D, faults, |row| {
            let stamp_ns = row.stamp_after("t_ns", &mut last);
            let rotation_rad = row.numbers(["rx", "ry", "rz"]);
            let translation_m = row.numbers(["dx", "dy", "dz"]);
            Some(Odometry3dRow {
                stamp_ns: stamp_ns?,
                rotation_rad: rotation_rad?,
                translation_m: translation_m?,
            })
        }))
    } else {
        Odometry::Planar(read_rows(table, ODOMETRY_2D, faults, |row| {
            let stamp_ns = row.stamp_after("t_ns", &mut last);
            let [dtheta_rad, dx, dy] = row.numbers(["dtheta", "dx", "dy"])?;
            Some(Odometry2dRow {
                stamp_ns: stamp_ns?,
                dtheta_rad,
                translation_m: [dx, dy],
            })
        }))
    }
}

/// The stamp and source of a fix: stamps must increase per source, because receivers interleave
/// freely.
pub(super) fn fix_stamp(
    row: &mut RowReader<'_>,
    last: &mut BTreeMap<u32, Option<u64>>,
) -> Option<(u64, u32)> {
    let source = row.source()?;
    let stamp_ns = row.stamp_after("t_ns", last.entry(source).or_default())?;
    Some((stamp_ns, source))
}

fn read_position(table: Table, faults: &mut Faults) -> Vec<PositionRow> {
    let mut last = BTreeMap::new();
    let header = if table.has("z") || table.has("sz") {
        POSITION
    } else {
        "t_ns,x,y,sx,sy"
    };
    read_rows(table, header, faults, |row| {
        let stamp = fix_stamp(row, &mut last);
        let planar = row.text("z").is_empty() && row.text("sz").is_empty();
        let (position, sigma) = if planar {
            let position = row.numbers(["x", "y"]).map(|[x, y]| [x, y, 0.0]);
            (
                position,
                row.sigmas(["sx", "sy"]).map(|[sx, sy]| [sx, sy, 0.0]),
            )
        } else {
            (row.numbers(["x", "y", "z"]), row.sigmas(["sx", "sy", "sz"]))
        };
        let (stamp_ns, source) = stamp?;
        let dimension = if planar { 2 } else { 3 };
        Some(PositionRow {
            stamp_ns,
            source,
            dimension,
            position_w_m: position?,
            sigma_m: sigma?,
        })
    })
}

fn read_velocity(table: Table, faults: &mut Faults) -> Vec<VelocityRow> {
    let mut last = BTreeMap::new();
    read_rows(table, VELOCITY, faults, |row| {
        let stamp = fix_stamp(row, &mut last);
        let velocity = row.numbers(["vx", "vy", "vz"]);
        let sigma = row.sigmas(["sx", "sy", "sz"]);
        let (stamp_ns, source) = stamp?;
        Some(VelocityRow {
            stamp_ns,
            source,
            velocity_w_mps: velocity?,
            sigma_mps: sigma?,
        })
    })
}

fn read_heading(table: Table, faults: &mut Faults) -> Vec<HeadingRow> {
    let mut last = BTreeMap::new();
    read_rows(table, HEADING, faults, |row| {
        let stamp = fix_stamp(row, &mut last);
        let heading = row.number("heading");
        let sigma = row.sigmas(["sigma"]);
        let ((stamp_ns, source), [sigma_rad]) = (stamp?, sigma?);
        Some(HeadingRow {
            stamp_ns,
            source,
            heading_rad: heading?,
            sigma_rad,
        })
    })
}

fn read_truth_table(table: Table, faults: &mut Faults) -> Truth {
    let mut last = None;
    if table.has("theta") {
        return Truth::Planar(read_rows(table, TRUTH_2D, faults, |row| {
            let stamp_ns = row.stamp_after("t_ns", &mut last);
            let [theta_rad, x, y] = row.numbers(["theta", "x", "y"])?;
            Some(Truth2dRow {
                stamp_ns: stamp_ns?,
                theta_rad,
                p_w_m: [x, y],
            })
        }));
    }
    let has_bias = GYRO_BIAS
        .iter()
        .chain(&ACCEL_BIAS)
        .all(|column| table.has(column));
    Truth::Spatial(read_rows(table, TRUTH, faults, |row| {
        let stamp_ns = row.stamp_after("t_ns", &mut last);
        let q_wb = row.quaternion(["qx", "qy", "qz", "qw"]);
        let v_w_mps = row.numbers(["vx", "vy", "vz"]);
        let p_w_m = row.numbers(["x", "y", "z"]);
        let bias = if has_bias {
            let (gyro, accel) = (row.numbers(GYRO_BIAS), row.numbers(ACCEL_BIAS));
            Some(ImuBias {
                gyro_rps: gyro?,
                accel_mps2: accel?,
            })
        } else {
            None
        };
        Some(TruthRow {
            stamp_ns: stamp_ns?,
            q_wb: q_wb?,
            v_w_mps: v_w_mps?,
            p_w_m: p_w_m?,
            bias,
        })
    }))
}
