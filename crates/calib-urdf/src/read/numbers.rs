//! The numbers of an attribute, as every URDF reader takes them: finite, separated by white space.

/// Why an attribute is not N finite numbers, and at which byte of the value.
pub(crate) struct NumberFault {
    pub(crate) offset: usize,
    pub(crate) reason: String,
}

/// N finite numbers, separated by white space, as every URDF reader takes them.
pub(crate) fn parse_numbers<const N: usize>(value: &str) -> Result<[f64; N], NumberFault> {
    let mut numbers = [0.0; N];
    let mut count = 0;
    for (offset, token) in tokens(value) {
        let number = parse_number(token).map_err(|reason| NumberFault { offset, reason })?;
        if let Some(place) = numbers.get_mut(count) {
            *place = number;
        }
        count += 1;
    }
    if count == N {
        Ok(numbers)
    } else {
        Err(NumberFault {
            offset: 0,
            reason: format!("there {} {count}", if count == 1 { "is" } else { "are" }),
        })
    }
}

fn parse_number(token: &str) -> Result<f64, String> {
    match token.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        // Rust reads 1e999 as infinity, and inf, infinity and nan as such.
        Ok(_) => Err(format!("`{token}` is not a finite number")),
        Err(_) if token.replace(',', ".").parse::<f64>().is_ok() => {
            Err(format!("`{token}` has a comma where numbers have a point"))
        }
        Err(_) if token.contains(',') => Err(format!(
            "`{token}`: numbers are separated by spaces, not by commas"
        )),
        Err(_) => Err(format!("`{token}` is not a number")),
    }
}

/// The words of an attribute's value with their byte offsets; white space as in XML.
pub(crate) fn tokens(value: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_space = |c: char| matches!(c, ' ' | '\t' | '\n' | '\r');
    value
        .split(is_space)
        .filter(|token| !token.is_empty())
        .map(move |token| {
            // Both are slices of the same text.
            (token.as_ptr() as usize - value.as_ptr() as usize, token)
        })
}
