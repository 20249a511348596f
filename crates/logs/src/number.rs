//! Numbers from text: the plain decimal case fast, everything else by the standard library.

use sensing::Stamp;

/// Powers of ten that `f32` holds exactly.
const POW10_F32: [f32; 11] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10];
/// Powers of ten that `f64` holds exactly, as far as they are needed here.
const POW10_F64: [f64; 20] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19,
];

/// Plain decimal text as `mantissa / 10^decimals`.
struct Decimal {
    negative: bool,
    mantissa: u64,
    decimals: usize,
}

/// Splits `-12.345` into sign, digits and decimals; `None` for anything less plain.
fn plain_decimal(text: &[u8]) -> Option<Decimal> {
    let (negative, digits) = match text.split_first() {
        Some((b'-', rest)) => (true, rest),
        _ => (false, text),
    };
    if digits.len() > 20 {
        return None;
    }
    let (mut mantissa, mut point) = (0u64, None);
    for (i, &byte) in digits.iter().enumerate() {
        let digit = byte.wrapping_sub(b'0');
        if digit <= 9 {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        } else if byte == b'.' && point.is_none() {
            point = Some(i);
        } else {
            return None;
        }
    }
    let decimals = point.map_or(0, |p| digits.len() - 1 - p);
    let count = digits.len() - usize::from(point.is_some());
    // Nineteen digits cannot overflow the mantissa.
    matches!(count, 1..=19).then_some(Decimal { negative, mantissa, decimals })
}

/// Same result as `str::parse::<f32>`.
///
/// A mantissa below 2^24 and a power of ten up to 10^10 are exact in `f32`, so that their quotient
/// is rounded once, correctly (Clinger 1990, "How to read floating point numbers accurately").
pub(crate) fn parse_f32(text: &[u8]) -> Option<f32> {
    if let Some(Decimal { negative, mantissa, decimals }) = plain_decimal(text)
        && mantissa < 1 << 24
        && decimals < POW10_F32.len()
    {
        let value = mantissa as f32 / POW10_F32[decimals];
        return Some(if negative { -value } else { value });
    }
    std::str::from_utf8(text).ok()?.parse().ok()
}

/// True for the bytes that separate numbers.
pub(crate) fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r')
}

/// The plain decimal number that `text` starts with, after blanks, and what follows it; `None`
/// where [`parse_f32`] has to look at the field. One pass: most bytes of a log go through here.
pub(crate) fn leading_f32(text: &[u8]) -> Option<(f32, &[u8])> {
    let start = text.iter().position(|&b| !is_blank(b))?;
    let text = &text[start..];
    let (mut mantissa, mut decimals, mut step, mut digits) = (0u32, 0, 0, 0);
    let mut end = text.len().min(9);
    for (i, &byte) in text.iter().enumerate().take(9) {
        let digit = byte.wrapping_sub(b'0');
        if digit <= 9 {
            mantissa = mantissa * 10 + u32::from(digit);
            decimals += step;
            digits += 1;
        } else if byte == b'.' && step == 0 {
            step = 1;
        } else if is_blank(byte) {
            end = i;
            break;
        } else {
            return None;
        }
    }
    let ended = text.get(end).is_none_or(|&b| is_blank(b));
    let exact = digits > 0 && mantissa < 1 << 24;
    (ended && exact).then(|| (mantissa as f32 / POW10_F32[decimals], &text[end..]))
}

/// Same result as `str::parse::<f64>`; exact operands as in [`parse_f32`].
pub(crate) fn parse_f64(text: &[u8]) -> Option<f64> {
    if let Some(Decimal { negative, mantissa, decimals }) = plain_decimal(text)
        && mantissa < 1 << 53
        && decimals < POW10_F64.len()
    {
        let value = mantissa as f64 / POW10_F64[decimals];
        return Some(if negative { -value } else { value });
    }
    std::str::from_utf8(text).ok()?.parse().ok()
}

/// Seconds as text to nanoseconds, exact for plain decimals; digits beyond the nanosecond are cut.
/// `None` for what is no number or does not fit.
pub(crate) fn parse_stamp(text: &[u8]) -> Option<Stamp> {
    if let Some(Decimal { negative, mantissa, decimals }) = plain_decimal(text) {
        let nanoseconds = if decimals <= 9 {
            mantissa.checked_mul(10u64.pow(9 - decimals as u32))?
        } else {
            mantissa / 10u64.pow(decimals as u32 - 9)
        };
        let nanoseconds = i64::try_from(nanoseconds).ok()?;
        return Some(Stamp(if negative { -nanoseconds } else { nanoseconds }));
    }
    let secs: f64 = std::str::from_utf8(text).ok()?.parse().ok()?;
    (secs.abs() < 9.2e9).then(|| Stamp::from_secs(secs))
}

/// A whole number of at most nineteen digits.
pub(crate) fn parse_u64(text: &[u8]) -> Option<u64> {
    match plain_decimal(text)? {
        Decimal { negative: false, mantissa, decimals: 0 } if !text.contains(&b'.') => {
            Some(mantissa)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn same_f32(text: &str) {
        let (ours, std) = (parse_f32(text.as_bytes()), text.parse::<f32>().ok());
        assert_eq!(ours.map(f32::to_bits), std.map(f32::to_bits), "{text:?}");
        if let Some((ours, rest)) = leading_f32(text.as_bytes()) {
            let field = text.trim_start_matches([' ', '\t', '\r']);
            let field = field.split([' ', '\t', '\r']).next().unwrap();
            assert_eq!(field.parse::<f32>().map(f32::to_bits), Ok(ours.to_bits()), "{text:?}");
            assert!(text.as_bytes().ends_with(rest));
        }
    }

    fn same_f64(text: &str) {
        let (ours, std) = (parse_f64(text.as_bytes()), text.parse::<f64>().ok());
        assert_eq!(ours.map(f64::to_bits), std.map(f64::to_bits), "{text:?}");
    }

    #[test]
    fn corner_cases_equal_the_standard_parser() {
        for text in [
            "",
            "-",
            ".",
            "-.",
            "0",
            "-0",
            "-0.0",
            "1.",
            ".5",
            "-.5",
            "1..2",
            "1.2.3",
            "+1",
            "+-1",
            "1e3",
            "nan",
            "NaN",
            "inf",
            "-inf",
            "infinity",
            "0x10",
            "81.83",
            "16777216",
            "16777217",
            "33554433",
            "9007199254740993",
            "99999999999999999999",
            " 1",
            "1 ",
            "0.00000000000000000001",
            "1_000",
            "12345678.9012345678",
            "١",
        ] {
            same_f32(text);
            same_f64(text);
        }
    }

    #[test]
    fn stamps_are_exact_and_bounded() {
        assert_eq!(parse_stamp(b"976052857.337530"), Some(Stamp(976_052_857_337_530_000)));
        assert_eq!(parse_stamp(b"1134864629.895182999"), Some(Stamp(1_134_864_629_895_182_999)));
        assert_eq!(parse_stamp(b"1.9999999999"), Some(Stamp(1_999_999_999)));
        assert_eq!(parse_stamp(b"-1.5"), Some(Stamp(-1_500_000_000)));
        assert_eq!(parse_stamp(b"1e3"), Some(Stamp(1_000_000_000_000)));
        for bad in ["", "nohost", "nan", "inf", "1e30", "9999999999999999999"] {
            assert_eq!(parse_stamp(bad.as_bytes()), None, "{bad}");
        }
    }

    #[test]
    fn counts_are_whole_numbers() {
        assert_eq!(parse_u64(b"180"), Some(180));
        for bad in ["", "-1", "1.0", "1.", "1e2", "x", "99999999999999999999"] {
            assert_eq!(parse_u64(bad.as_bytes()), None, "{bad}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn plain_numbers_equal_the_standard_parser(text in "-?[0-9]{0,14}(\\.[0-9]{0,12})?") {
            same_f32(&text);
            same_f64(&text);
        }

        #[test]
        fn any_text_equals_the_standard_parser(text in "[-+0-9.eE]{0,8}|\\PC{0,6}") {
            same_f32(&text);
            same_f64(&text);
        }

        #[test]
        fn printed_floats_come_back(value in any::<f32>(), wide in any::<f64>()) {
            same_f32(&value.to_string());
            same_f64(&wide.to_string());
            same_f32(&format!("{:.6}", value));
        }
    }
}
