//! Writing a dataset folder: the layout that [`Dataset::load`] reads, every double exactly.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::{Dataset, DatasetError, Odometry, Truth};
use crate::table::write::write_numbers;

type Out = BufWriter<File>;

impl Dataset {
    /// Writes the dataset into `dir`, which is made if need be. Kinds of data that are not there
    /// get no file; files of theirs from an earlier save are removed, so that the folder holds this
    /// dataset and no mixture.
    ///
    /// # Errors
    /// [`DatasetError::File`] with the file that could not be written.
    ///
    /// ```
    /// use inekf_client::dataset::{Dataset, HeadingRow, ImuRow};
    ///
    /// let mut drive = Dataset {
    ///     imu: vec![ImuRow { stamp_ns: 1, gyro_rps: [0.1, 0.0, 0.0], accel_mps2: [0.0, 0.0, 9.8] }],
    ///     heading: vec![HeadingRow { stamp_ns: 1, source: 0, heading_rad: 0.3, sigma_rad: 0.1 }],
    ///     ..Dataset::default()
    /// };
    /// let folder = tempfile::tempdir()?;
    /// drive.save(folder.path())?;
    /// // A folder holds one dataset and no mixture: what is there no more has no file.
    /// drive.heading.clear();
    /// drive.save(folder.path())?;
    /// assert!(!folder.path().join("heading.csv").exists());
    /// assert_eq!(Dataset::load(folder.path())?, drive);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn save(&self, dir: impl AsRef<Path>) -> Result<(), DatasetError> {
        let dir = dir.as_ref();
        fs::create_dir_all(dir).map_err(|cause| DatasetError::File {
            path: dir.to_owned(),
            cause,
        })?;
        let (has_odometry, has_truth) =
            (self.odometry != Odometry::None, self.truth != Truth::None);
        write_file(dir, "meta.json", true, |out| {
            out.write_all(self.meta.to_json().as_bytes())
        })?;
        write_file(dir, "imu.csv", !self.imu.is_empty(), |out| {
            self.write_imu(out)
        })?;
        write_file(dir, "odometry.csv", has_odometry, |out| {
            self.write_odometry(out)
        })?;
        write_file(dir, "position.csv", !self.position.is_empty(), |out| {
            self.write_position(out)
        })?;
        write_file(dir, "velocity.csv", !self.velocity.is_empty(), |out| {
            self.write_velocity(out)
        })?;
        write_file(dir, "heading.csv", !self.heading.is_empty(), |out| {
            self.write_heading(out)
        })?;
        write_file(dir, "truth.csv", has_truth, |out| {
            write_truth(&self.truth, out)
        })
    }

    fn write_imu(&self, out: &mut Out) -> io::Result<()> {
        writeln!(out, "t_ns,gx,gy,gz,ax,ay,az")?;
        for row in &self.imu {
            write_row(out, row.stamp_ns, &[&row.gyro_rps, &row.accel_mps2])?;
        }
        Ok(())
    }

    fn write_odometry(&self, out: &mut Out) -> io::Result<()> {
        match &self.odometry {
            Odometry::None => {}
            Odometry::Planar(rows) => {
                writeln!(out, "t_ns,dtheta,dx,dy")?;
                for row in rows {
                    write_row(out, row.stamp_ns, &[&[row.dtheta_rad], &row.translation_m])?;
                }
            }
            Odometry::Spatial(rows) => {
                writeln!(out, "t_ns,rx,ry,rz,dx,dy,dz")?;
                for row in rows {
                    write_row(out, row.stamp_ns, &[&row.rotation_rad, &row.translation_m])?;
                }
            }
        }
        Ok(())
    }

    fn write_position(&self, out: &mut Out) -> io::Result<()> {
        writeln!(out, "t_ns,source,x,y,z,sx,sy,sz")?;
        for row in &self.position {
            write!(out, "{},{}", row.stamp_ns, row.source)?;
            if row.dimension == 2 {
                write_numbers(out, &row.position_w_m[..2])?;
                out.write_all(b",")?;
                write_numbers(out, &row.sigma_m[..2])?;
                out.write_all(b",\n")?;
            } else {
                write_numbers(out, &row.position_w_m)?;
                write_numbers(out, &row.sigma_m)?;
                out.write_all(b"\n")?;
            }
        }
        Ok(())
    }

    fn write_velocity(&self, out: &mut Out) -> io::Result<()> {
        writeln!(out, "t_ns,source,vx,vy,vz,sx,sy,sz")?;
        for row in &self.velocity {
            write!(out, "{},{}", row.stamp_ns, row.source)?;
            write_numbers(out, &row.velocity_w_mps)?;
            write_numbers(out, &row.sigma_mps)?;
            out.write_all(b"\n")?;
        }
        Ok(())
    }

    fn write_heading(&self, out: &mut Out) -> io::Result<()> {
        writeln!(out, "t_ns,source,heading,sigma")?;
        for row in &self.heading {
            write!(out, "{},{}", row.stamp_ns, row.source)?;
            write_numbers(out, &[row.heading_rad, row.sigma_rad])?;
            out.write_all(b"\n")?;
        }
        Ok(())
    }
}

/// Writes the `truth.csv` of a folder, which is made if need be, and leaves its other files alone.
///
/// # Errors
/// [`DatasetError::File`] with the file that could not be written.
///
/// ```
/// use inekf_client::dataset::{Truth, Truth2dRow, save_truth};
///
/// let row = Truth2dRow { stamp_ns: 5, theta_rad: 0.5, p_w_m: [1.0, 2.0] };
/// let folder = tempfile::tempdir()?;
/// save_truth(folder.path(), &Truth::Planar(vec![row]))?;
/// let text = std::fs::read_to_string(folder.path().join("truth.csv"))?;
/// assert_eq!(text, "t_ns,theta,x,y\n5,0.5,1.0,2.0\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn save_truth(dir: impl AsRef<Path>, truth: &Truth) -> Result<(), DatasetError> {
    let dir = dir.as_ref();
    fs::create_dir_all(dir).map_err(|cause| DatasetError::File {
        path: dir.to_owned(),
        cause,
    })?;
    write_file(dir, "truth.csv", *truth != Truth::None, |out| {
        write_truth(truth, out)
    })
}

fn write_truth(truth: &Truth, out: &mut Out) -> io::Result<()> {
    match truth {
        Truth::None => {}
        Truth::Planar(rows) => {
            writeln!(out, "t_ns,theta,x,y")?;
            for row in rows {
                write_row(out, row.stamp_ns, &[&[row.theta_rad], &row.p_w_m])?;
            }
        }
        Truth::Spatial(rows) => {
            // Bias columns only if every row has them: a column cannot be there for some rows.
            let with_bias = !rows.is_empty() && rows.iter().all(|row| row.bias.is_some());
            let bias_columns = if with_bias {
                ",bgx,bgy,bgz,bax,bay,baz"
            } else {
                ""
            };
            writeln!(out, "t_ns,qw,qx,qy,qz,vx,vy,vz,x,y,z{bias_columns}")?;
            for row in rows {
                let [x, y, z, w] = row.q_wb;
                let q_wxyz = [w, x, y, z];
                match row.bias.filter(|_| with_bias) {
                    None => write_row(out, row.stamp_ns, &[&q_wxyz, &row.v_w_mps, &row.p_w_m])?,
                    Some(bias) => {
                        let (gyro, accel) = (&bias.gyro_rps, &bias.accel_mps2);
                        write_row(
                            out,
                            row.stamp_ns,
                            &[&q_wxyz, &row.v_w_mps, &row.p_w_m, gyro, accel],
                        )?;
                    }
                }
            }
        }
    }
    Ok(())
}

/// Writes one row: the stamp, then all groups of numbers.
fn write_row(out: &mut Out, stamp_ns: u64, groups: &[&[f64]]) -> io::Result<()> {
    write!(out, "{stamp_ns}")?;
    for group in groups {
        write_numbers(out, group)?;
    }
    out.write_all(b"\n")
}

/// Writes a file if it is wanted, and removes an old one if not.
fn write_file(
    dir: &Path,
    name: &str,
    wanted: bool,
    write: impl FnOnce(&mut Out) -> io::Result<()>,
) -> Result<(), DatasetError> {
    let path = dir.join(name);
    let done = if wanted {
        File::create(&path).and_then(|file| {
            let mut out = BufWriter::new(file);
            write(&mut out)?;
            out.flush()
        })
    } else {
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    };
    done.map_err(|cause| DatasetError::File { path, cause })
}
