//! The estimates of a recording as a table, as the estimate CSV has them, and the NIS of the fixes that made them.
//!
//! Nothing is replayed: what the daemon published is what is read. A frame that is damaged is left out; the row of its
//! stamp is then the estimate before it, or missing.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use anyhow::{Context, bail};
use inekf_shared::codec::FRAME_MAGIC;
use inekf_shared::message::{EstimateSe2, EstimateSe3, EstimateSe23, MAX_SOURCES};

use super::read::{Damage, Item, Reader};
use crate::model::{Estimate, Model};
use crate::report::NisSample;
use crate::rows::{RowBuilder, row};
use crate::table::{EstimateTable, Layout};

/// What a recording says of the estimate.
///
/// ```
/// use inekf_client::recording::estimates::read_estimates;
/// use inekf_client::recording::{Head, RECORDING_VERSION, Writer};
/// use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe2, MODEL_ODOMETRY_2D, Zero};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("drive.rec");
/// let head = Head {
///     version: RECORDING_VERSION,
///     model: MODEL_ODOMETRY_2D,
///     instance: "cart".to_owned(),
///     began_unix_s: 0,
///     config: String::new(),
/// };
/// let mut writer = Writer::create(&path, &head)?;
/// for stamp_ns in [10, 20] {
///     let mut estimate = EstimateSe2::ZERO;
///     (estimate.head.stamp_ns, estimate.head.flags) = (stamp_ns, ESTIMATE_PROPAGATED);
///     writer.estimate(&estimate)?;
/// }
/// writer.finish()?;
/// // A process that is killed leaves half a frame: a row less, and it is said.
/// let file = std::fs::OpenOptions::new().write(true).open(&path)?;
/// file.set_len(file.metadata()?.len() - 1)?;
/// let estimates = read_estimates(&path)?;
/// assert_eq!(estimates.table.rows.len(), 1);
/// assert!(estimates.damage.torn > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates {
    /// A row for each propagated sample, after the updates due at its stamp, with covariance.
    pub table: EstimateTable,
    /// The normalised innovation squared of each position fix, also of those that were gated, in the order in which they
    /// were judged; the stamp is that of the first estimate that says so.
    pub nis: Vec<NisSample>,
    /// What could not be read.
    pub damage: Damage,
}

/// Whether the file at `path` begins like a recording.
///
/// # Errors
/// It cannot be read.
///
/// ```
/// use inekf_client::recording::estimates::is_recording;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("estimate.csv");
/// std::fs::write(&path, "t_ns,theta,x,y\n")?;
/// // So `report` tells a recording from an estimate CSV.
/// assert!(!is_recording(&path)?);
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn is_recording(path: &Path) -> io::Result<bool> {
    let mut start = Vec::new();
    let beginning = FRAME_MAGIC.len() as u64;
    File::open(path)?.take(beginning).read_to_end(&mut start)?;
    Ok(start == FRAME_MAGIC)
}

/// Reads the estimates of the recording at `path`.
///
/// # Errors
/// It cannot be read, is no recording, or has no estimates.
///
/// ```
/// use inekf_client::recording::estimates::read_estimates;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("drive.rec");
/// std::fs::write(&path, "not a frame")?;
/// let error = read_estimates(&path).expect_err("it is no recording");
/// assert!(format!("{error:#}").contains("this is no recording"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn read_estimates(path: &Path) -> anyhow::Result<Estimates> {
    let reader = Reader::open(path)?;
    let model =
        Model::from_code(reader.head().model).context("the recording is of an unknown model")?;
    let read = match model {
        Model::Imu => read::<EstimateSe23, _>(reader),
        Model::Odometry3d => read::<EstimateSe3, _>(reader),
        Model::Odometry2d => read::<EstimateSe2, _>(reader),
    };
    read.with_context(|| path.display().to_string())
}

fn read<E: Estimate, R: Read>(mut reader: Reader<R>) -> anyhow::Result<Estimates> {
    let mut builder = RowBuilder::<E>::default();
    let (mut rows, mut nis) = (Vec::new(), Vec::new());
    let mut last_nis = [f64::NAN; MAX_SOURCES];
    let mut dimension = None;
    while let Some(item) = reader.next_item::<E>()? {
        let Item::Estimate(estimate) = item else {
            continue;
        };
        let head = *estimate.head();
        dimension.get_or_insert(head.dimension as usize);
        nis.extend(
            judged(&last_nis, &head.nis, E::LAYOUT).map(|(nis, degrees)| NisSample {
                stamp_ns: head.stamp_ns,
                nis,
                degrees,
            }),
        );
        last_nis = head.nis;
        rows.extend(builder.push(estimate).as_ref().map(row));
    }
    rows.extend(builder.finish().as_ref().map(row));
    if rows.is_empty() {
        bail!("the recording has no estimates: the daemon had no state yet");
    }
    Ok(Estimates {
        table: EstimateTable {
            layout: E::LAYOUT,
            covariance_dimension: dimension,
            rows,
        },
        nis,
        damage: reader.damage(),
    })
}

/// The NIS that were not there before, with their degrees of freedom: 3 for a fix, 2 in the plane, and twice as many for
/// two sources that were taken together, which say the same.
fn judged(
    before: &[f64; MAX_SOURCES],
    after: &[f64; MAX_SOURCES],
    layout: Layout,
) -> impl Iterator<Item = (f64, usize)> {
    let degrees = if layout == Layout::Plane { 2 } else { 3 };
    let mut found: Vec<(f64, usize)> = Vec::new();
    for (before, after) in before.iter().zip(after) {
        if after.is_nan() || before.to_bits() == after.to_bits() {
            continue;
        }
        match found.iter_mut().find(|(nis, _)| nis == after) {
            Some((_, together)) => *together += degrees,
            None => found.push((*after, degrees)),
        }
    }
    found.into_iter()
}
