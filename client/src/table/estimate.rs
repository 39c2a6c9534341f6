//! The estimate CSV: one row per propagated sample, after the updates due at that stamp.
//!
//! Columns, by model ([`Layout`]):
//!
//! * navigation, SE_2(3) with biases: `t_ns,qx,qy,qz,qw,vx,vy,vz,x,y,z,bgx,bgy,bgz,bax,bay,baz`;
//! * pose, SE(3): `t_ns,qx,qy,qz,qw,x,y,z`;
//! * plane, SE(2): `t_ns,theta,x,y`.
//!
//! With covariance the upper triangle follows, row by row, as `p_i_j`: of the left-invariant error
//! in body coordinates (`chi = chi_hat * exp(xi)`), ordered rotation, velocity, position, gyro
//! bias, accelerometer bias (navigation); rotation, position (pose); theta, x, y (plane).
//! Quaternions Hamilton, body to world; world ENU, body FLU; SI units.
//!
//! ```
//! use inekf_client::table::{EstimateState, EstimateWriter, Layout, read_estimates};
//!
//! let mut writer = EstimateWriter::new(Vec::new(), Layout::Plane, None)?;
//! let state = EstimateState::Plane { theta_rad: 0.5, p_w_m: [1.0, 0.1] };
//! writer.write(1_000_000, &state, &[])?;
//! let text = writer.finish()?;
//! assert_eq!(String::from_utf8(text.clone())?, "t_ns,theta,x,y\n1000000,0.5,1.0,0.1\n");
//! assert_eq!(read_estimates("plane.csv", &text[..])?.rows[0].state, state);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::io::{self, Read, Write};

use super::fault::{Fault, Faults};
use super::read::{CsvTable, RowReader};
use super::write::write_numbers;

const QUATERNION: [&str; 4] = ["qx", "qy", "qz", "qw"];
const VELOCITY: [&str; 3] = ["vx", "vy", "vz"];
const POSITION: [&str; 3] = ["x", "y", "z"];
const GYRO_BIAS: [&str; 3] = ["bgx", "bgy", "bgz"];
const ACCEL_BIAS: [&str; 3] = ["bax", "bay", "baz"];

/// Which columns an estimate CSV has.
///
/// ```
/// use inekf_client::table::{EstimateState, Layout};
///
/// let state = EstimateState::Plane { theta_rad: 0.0, p_w_m: [0.0; 2] };
/// assert_eq!(state.layout(), Layout::Plane);
/// assert_eq!(Layout::Plane.header(), "t_ns,theta,x,y");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// SE_2(3) with both biases.
    Navigation,
    /// SE(3).
    Pose,
    /// SE(2).
    Plane,
}

impl Layout {
    /// The header without covariance.
    ///
    /// ```
    /// use inekf_client::table::Layout;
    ///
    /// // Quaternions x, y, z, w.
    /// assert_eq!(Layout::Pose.header(), "t_ns,qx,qy,qz,qw,x,y,z");
    /// ```
    pub fn header(self) -> &'static str {
        match self {
            Self::Navigation => "t_ns,qx,qy,qz,qw,vx,vy,vz,x,y,z,bgx,bgy,bgz,bax,bay,baz",
            Self::Pose => "t_ns,qx,qy,qz,qw,x,y,z",
            Self::Plane => "t_ns,theta,x,y",
        }
    }
}

/// The mean of one estimate.
///
/// ```
/// use inekf_client::table::{EstimateState, Layout};
///
/// let level = EstimateState::Pose { q_wb: [0.0, 0.0, 0.0, 1.0], p_w_m: [1.0, 2.0, 3.0] };
/// assert_eq!(level.layout(), Layout::Pose);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EstimateState {
    /// SE_2(3) with both biases.
    Navigation {
        /// Attitude, `[x, y, z, w]`, body to world.
        q_wb: [f64; 4],
        /// Velocity in the world frame, m/s.
        v_w_mps: [f64; 3],
        /// Position in the world frame, m.
        p_w_m: [f64; 3],
        /// Gyro bias, rad/s, body frame.
        gyro_bias_rps: [f64; 3],
        /// Accelerometer bias, m/s^2, body frame.
        accel_bias_mps2: [f64; 3],
    },
    /// SE(3).
    Pose {
        /// Attitude, `[x, y, z, w]`, body to world.
        q_wb: [f64; 4],
        /// Position in the world frame, m.
        p_w_m: [f64; 3],
    },
    /// SE(2).
    Plane {
        /// Heading, rad, counter-clockwise from the world x axis.
        theta_rad: f64,
        /// Position in the plane, m.
        p_w_m: [f64; 2],
    },
}

impl EstimateState {
    /// The layout this state is written in.
    ///
    /// ```
    /// use inekf_client::table::{EstimateState, Layout};
    ///
    /// assert_eq!(EstimateState::Plane { theta_rad: 0.0, p_w_m: [0.0; 2] }.layout(), Layout::Plane);
    /// ```
    pub fn layout(&self) -> Layout {
        match self {
            Self::Navigation { .. } => Layout::Navigation,
            Self::Pose { .. } => Layout::Pose,
            Self::Plane { .. } => Layout::Plane,
        }
    }
}

/// One row of an estimate CSV.
///
/// ```
/// use inekf_client::table::{EstimateRow, EstimateState};
/// use inekf_shared::message::triangle_index;
///
/// let row = EstimateRow {
///     stamp_ns: 0,
///     state: EstimateState::Plane { theta_rad: 0.0, p_w_m: [0.0; 2] },
///     covariance: vec![0.01, 0.0, 0.1, 4.0, 0.0, 9.0],
/// };
/// // theta, x, y: the covariance of theta with y, and the variance of y.
/// let entry = |i, j| triangle_index(i, j, 3).map(|at| row.covariance[at]);
/// assert_eq!((entry(2, 0), entry(2, 2)), (Some(0.1), Some(9.0)));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateRow {
    /// Stamp of the sample that was propagated, ns of the sensor clock.
    pub stamp_ns: u64,
    /// The mean.
    pub state: EstimateState,
    /// Upper triangle of the covariance, row by row; empty without covariance.
    pub covariance: Vec<f64>,
}

/// Number of entries in the upper triangle of a square matrix of this size.
///
/// ```
/// use inekf_client::table::estimate::triangle_len;
///
/// assert_eq!([3, 6, 9, 15].map(triangle_len), [6, 21, 45, 120]);
/// ```
pub fn triangle_len(dimension: usize) -> usize {
    dimension * (dimension + 1) / 2
}

/// Writes an estimate CSV. Give it a buffered writer: every row is several small writes.
///
/// ```
/// use inekf_client::table::{EstimateState, EstimateWriter, Layout};
///
/// let mut writer = EstimateWriter::new(Vec::new(), Layout::Plane, Some(3))?;
/// let state = EstimateState::Plane { theta_rad: 0.1, p_w_m: [0.0; 2] };
/// writer.write(5, &state, &[1.0, 0.0, 0.0, 1.0, 0.0, 1.0])?;
/// let text = String::from_utf8(writer.finish()?)?;
/// assert!(text.starts_with("t_ns,theta,x,y,p_0_0,p_0_1,p_0_2,p_1_1,p_1_2,p_2_2\n5,0.1,"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct EstimateWriter<W> {
    out: W,
    layout: Layout,
    triangle: usize,
}

impl<W: Write> EstimateWriter<W> {
    /// Writes the header. `covariance_dimension` is the size of the covariance (15 or 9, 6, 3) or
    /// `None` for none.
    ///
    /// # Errors
    /// What the writer reports.
    ///
    /// ```
    /// use inekf_client::table::{EstimateWriter, Layout};
    ///
    /// // The header is written at once: an estimate that never came leaves a table without rows.
    /// let writer = EstimateWriter::new(Vec::new(), Layout::Plane, None)?;
    /// assert_eq!(writer.finish()?, b"t_ns,theta,x,y\n");
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn new(
        mut out: W,
        layout: Layout,
        covariance_dimension: Option<usize>,
    ) -> io::Result<Self> {
        let dimension = covariance_dimension.unwrap_or(0);
        out.write_all(layout.header().as_bytes())?;
        for i in 0..dimension {
            for j in i..dimension {
                write!(out, ",p_{i}_{j}")?;
            }
        }
        out.write_all(b"\n")?;
        Ok(Self {
            out,
            layout,
            triangle: triangle_len(dimension),
        })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// `InvalidInput` if the state's layout or the covariance's length is not the header's; else
    /// what the writer reports.
    ///
    /// ```
    /// use inekf_client::table::{EstimateState, EstimateWriter, Layout};
    ///
    /// let mut writer = EstimateWriter::new(Vec::new(), Layout::Plane, None)?;
    /// // What is not of the table's kind is refused, and the table stays whole.
    /// let pose = EstimateState::Pose { q_wb: [0.0, 0.0, 0.0, 1.0], p_w_m: [0.0; 3] };
    /// assert!(writer.write(5, &pose, &[]).is_err());
    /// assert_eq!(writer.finish()?, b"t_ns,theta,x,y\n");
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn write(
        &mut self,
        stamp_ns: u64,
        state: &EstimateState,
        covariance: &[f64],
    ) -> io::Result<()> {
        if state.layout() != self.layout || covariance.len() != self.triangle {
            let what = format!(
                "a {:?} row with {} covariance entries does not fit a {:?} table with {}",
                state.layout(),
                covariance.len(),
                self.layout,
                self.triangle
            );
            return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
        }
        write!(self.out, "{stamp_ns}")?;
        match state {
            EstimateState::Navigation {
                q_wb,
                v_w_mps,
                p_w_m,
                gyro_bias_rps,
                accel_bias_mps2,
            } => {
                write_numbers(&mut self.out, q_wb)?;
                for vector in [v_w_mps, p_w_m, gyro_bias_rps, accel_bias_mps2] {
                    write_numbers(&mut self.out, vector)?;
                }
            }
            EstimateState::Pose { q_wb, p_w_m } => {
                write_numbers(&mut self.out, q_wb)?;
                write_numbers(&mut self.out, p_w_m)?;
            }
            EstimateState::Plane { theta_rad, p_w_m } => {
                write_numbers(&mut self.out, &[*theta_rad])?;
                write_numbers(&mut self.out, p_w_m)?;
            }
        }
        write_numbers(&mut self.out, covariance)?;
        self.out.write_all(b"\n")
    }

    /// Flushes and gives the inner writer back; dropping without it loses no row but hides a failed
    /// flush.
    ///
    /// # Errors
    /// What the writer reports.
    ///
    /// ```
    /// use inekf_client::table::{EstimateState, EstimateWriter, Layout};
    ///
    /// let mut writer = EstimateWriter::new(Vec::new(), Layout::Plane, None)?;
    /// writer.write(5, &EstimateState::Plane { theta_rad: 0.5, p_w_m: [1.0, 2.0] }, &[])?;
    /// assert_eq!(String::from_utf8(writer.finish()?)?.lines().count(), 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// A whole estimate CSV.
///
/// ```
/// use inekf_client::table::{Layout, read_estimates};
///
/// let table = read_estimates("a.csv", &b"t_ns,theta,x,y\n1,0.5,1.0,2.0\n2,0.6,1.5,2.5\n"[..])?;
/// assert_eq!((table.layout, table.covariance_dimension), (Layout::Plane, None));
/// assert_eq!(table.rows.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateTable {
    /// Which columns it has.
    pub layout: Layout,
    /// Size of the covariance, if it has one.
    pub covariance_dimension: Option<usize>,
    /// The rows, in the order of their stamps.
    pub rows: Vec<EstimateRow>,
}

/// Reads an estimate CSV; the layout is told from the header. `file` is the name used in faults.
///
/// # Errors
/// Every fault found, with line and column (a number that is not finite is one).
///
/// ```
/// use inekf_client::table::read_estimates;
///
/// // Every fault at once, with line and column.
/// let faults = read_estimates("a.csv", &b"t_ns,theta,x,y\n1,inf,1.0,2.0\n2,0.6,,2.5\n"[..])
///     .expect_err("two faults");
/// assert_eq!(faults.len(), 2);
/// assert!(faults.list()[0].to_string().starts_with("a.csv line 2 theta"));
/// ```
pub fn read_estimates(file: &str, input: impl Read) -> Result<EstimateTable, Faults> {
    let mut faults = Faults::new();
    let Some(table) = CsvTable::open(file, input, Layout::Navigation.header(), &mut faults) else {
        return Err(faults);
    };
    let layout = if table.has("theta") {
        Layout::Plane
    } else if table.has("vx") {
        Layout::Navigation
    } else {
        Layout::Pose
    };
    let columns: Vec<&str> = layout.header().split(',').collect();
    let entries: Vec<String> = table
        .header()
        .iter()
        .filter(|name| name.starts_with("p_"))
        .cloned()
        .collect();
    let dimension = (0..=15).find(|&dimension| triangle_len(dimension) == entries.len());
    let covariance_names: Vec<String> = dimension
        .map(|n| {
            (0..n)
                .flat_map(|i| (i..n).map(move |j| format!("p_{i}_{j}")))
                .collect()
        })
        .unwrap_or_default();
    if !table.require(&columns, &mut faults) {
        return Err(faults);
    }
    let mut named = covariance_names.clone();
    named.sort_unstable();
    let mut found = entries;
    found.sort_unstable();
    if named != found {
        let problem = format!(
            "{} covariance columns that do not make a triangle",
            found.len()
        );
        let remedy = "name p_i_j for the upper triangle, row by row, or none";
        faults.push(Fault::in_file(file, problem, remedy).at_line(1));
        return Err(faults);
    }
    let mut last = None;
    let rows = table.rows(&mut faults, |row| {
        let stamp_ns = row.stamp_after("t_ns", &mut last)?;
        let state = read_state(layout, row)?;
        let covariance: Option<Vec<f64>> = covariance_names
            .iter()
            .map(|name| row.number(name))
            .collect();
        Some(EstimateRow {
            stamp_ns,
            state,
            covariance: covariance?,
        })
    });
    if !faults.is_empty() {
        return Err(faults);
    }
    let covariance_dimension = dimension.filter(|&dimension| dimension > 0);
    Ok(EstimateTable {
        layout,
        covariance_dimension,
        rows,
    })
}

fn read_state(layout: Layout, row: &mut RowReader<'_>) -> Option<EstimateState> {
    Some(match layout {
        Layout::Navigation => EstimateState::Navigation {
            q_wb: row.quaternion(QUATERNION)?,
            v_w_mps: row.numbers(VELOCITY)?,
            p_w_m: row.numbers(POSITION)?,
            gyro_bias_rps: row.numbers(GYRO_BIAS)?,
            accel_bias_mps2: row.numbers(ACCEL_BIAS)?,
        },
        Layout::Pose => EstimateState::Pose {
            q_wb: row.quaternion(QUATERNION)?,
            p_w_m: row.numbers(POSITION)?,
        },
        Layout::Plane => EstimateState::Plane {
            theta_rad: row.number("theta")?,
            p_w_m: row.numbers(["x", "y"])?,
        },
    })
}
