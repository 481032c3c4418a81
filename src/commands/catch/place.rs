//! Positions and offsets on the command line: `X,Y,Z`, in metres.

/// Parses three numbers.
pub fn place(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "expected three numbers, X,Y,Z in metres".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_three_numbers() {
        assert_eq!(place("4.2,-0.1, 1"), Ok([4.2, -0.1, 1.0]));
        for wrong in ["", "4", "4,5", "4,5,6,7", "4,x,6", "4,nan,6", "4,inf,6"] {
            assert!(place(wrong).unwrap_err().contains("X,Y,Z"), "{wrong}");
        }
    }
}
