//! Thinning of long series, so that a figure holds no more points than can be seen.

/// The samples of a series of `len` values, cut into at most `buckets` runs: `(start, end)` of each.
pub fn buckets(len: usize, buckets: usize) -> impl Iterator<Item = (usize, usize)> {
    let size = len.div_ceil(buckets.max(1)).max(1);
    (0..len)
        .step_by(size)
        .map(move |start| (start, (start + size).min(len)))
}

/// Indices of a run's least and greatest value, in the order in which they come; one if they agree.
pub fn extremes(values: &[f64], start: usize, end: usize) -> impl Iterator<Item = usize> {
    let run = start..end;
    let low = run
        .clone()
        .min_by(|a, b| values[*a].total_cmp(&values[*b]))
        .unwrap_or(start);
    let high = run
        .max_by(|a, b| values[*a].total_cmp(&values[*b]))
        .unwrap_or(start);
    let (first, second) = (low.min(high), low.max(high));
    std::iter::once(first).chain((second != first).then_some(second))
}

/// A path without the points that lie closer than `distance` to the last one kept; its end stays.
pub fn path(points: &[[f64; 2]], distance: f64) -> Vec<[f64; 2]> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for (index, point) in points.iter().enumerate() {
        let far = kept
            .last()
            .is_none_or(|last| (last[0] - point[0]).hypot(last[1] - point[1]) >= distance);
        if far || index + 1 == points.len() {
            kept.push(*point);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_cover_everything_once() {
        for (len, count) in [(0, 5), (1, 5), (7, 3), (1000, 64), (64, 64)] {
            let runs: Vec<_> = buckets(len, count).collect();
            assert!(runs.len() <= count);
            let covered: Vec<usize> = runs.iter().flat_map(|(start, end)| *start..*end).collect();
            assert_eq!(covered, (0..len).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_spike_survives() {
        let mut values = vec![0.0; 1000];
        values[537] = 9.0;
        let kept: Vec<usize> = buckets(values.len(), 20)
            .flat_map(|(start, end)| extremes(&values, start, end))
            .collect();
        assert!(kept.contains(&537));
        assert!(kept.len() <= 40 && kept.is_sorted());
    }

    #[test]
    fn path_keeps_both_ends() {
        let points: Vec<[f64; 2]> = (0..=1000).map(|i| [f64::from(i) * 0.01, 0.0]).collect();
        let kept = path(&points, 1.0);
        assert_eq!(kept.first(), points.first());
        assert_eq!(kept.last(), points.last());
        assert!(kept.len() <= 12, "{}", kept.len());
    }
}
