//! Rank correlation of what was predicted with what came true.

/// Spearman's rank correlation of two series of one length, ties sharing the mean of their ranks; 0 where one of them does not vary.
pub(crate) fn spearman(x: &[f64], y: &[f64]) -> f64 {
    let ranks = |values: &[f64]| {
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
        let mut ranks = vec![0.0; values.len()];
        for run in order.chunk_by(|&i, &j| values[i] == values[j]) {
            let first = order.partition_point(|&i| values[i].total_cmp(&values[run[0]]).is_lt());
            for &i in run {
                ranks[i] = first as f64 + 0.5 * (run.len() - 1) as f64;
            }
        }
        let mean = 0.5 * (values.len() as f64 - 1.0);
        ranks.iter().map(|r| r - mean).collect::<Vec<f64>>()
    };
    let (x, y) = (ranks(x), ranks(y));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p * q).sum::<f64>();
    let scale = (product(&x, &x) * product(&y, &y)).sqrt();
    if scale > 0.0 { product(&x, &y) / scale } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rank_correlation_of_known_series() {
        assert!((spearman(&[1.0, 2.0, 3.0, 4.0], &[10.0, 20.0, 25.0, 90.0]) - 1.0).abs() < 1e-15);
        assert!((spearman(&[1.0, 2.0, 3.0], &[3.0, 2.0, -1.0]) + 1.0).abs() < 1e-15);
        // Ranks 0.5, 0.5, 2 against 0, 1, 2: 1.5 / sqrt(1.5 * 2).
        assert!((spearman(&[1.0, 1.0, 5.0], &[1.0, 2.0, 3.0]) - 0.75f64.sqrt()).abs() < 1e-15);
        assert_eq!(spearman(&[1.0, 1.0], &[1.0, 2.0]), 0.0);
    }
}
