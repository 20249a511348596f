//! CRC-64/XZ (ECMA-182, reflected): the checksum of rows and of the chain of changes.
//!
//! A CRC because rows are short and errors on disks and in memory come as bursts: every burst of up
//! to 64 bits is found for certain, anything else with a probability of 1 - 2^-64. It guards
//! against accidents, not against people.

/// The polynomial of ECMA-182, bits reversed.
const POLYNOMIAL: u64 = 0xC96C_5795_D787_0F42;

const TABLES: [[u64; 256]; 8] = tables();

const fn tables() -> [[u64; 256]; 8] {
    let mut tables = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u64;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ POLYNOMIAL } else { crc >> 1 };
            bit += 1;
        }
        tables[0][byte] = crc;
        byte += 1;
    }
    let mut slice = 1;
    while slice < 8 {
        let mut byte = 0;
        while byte < 256 {
            let crc = tables[slice - 1][byte];
            tables[slice][byte] = (crc >> 8) ^ tables[0][(crc & 0xff) as usize];
            byte += 1;
        }
        slice += 1;
    }
    tables
}

/// A checksum being taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crc64(u64);

impl Crc64 {
    pub fn new() -> Self {
        Crc64(!0)
    }

    /// Takes in bytes, eight at a time.
    pub fn update(mut self, bytes: &[u8]) -> Self {
        let mut words = bytes.chunks_exact(8);
        for word in &mut words {
            let word = u64::from_le_bytes([
                word[0], word[1], word[2], word[3], word[4], word[5], word[6], word[7],
            ]);
            let mixed = (self.0 ^ word).to_le_bytes();
            self.0 = (0..8).fold(0, |crc, i| crc ^ TABLES[7 - i][usize::from(mixed[i])]);
        }
        for &byte in words.remainder() {
            self.0 = (self.0 >> 8) ^ TABLES[0][usize::from(self.0 as u8 ^ byte)];
        }
        self
    }

    pub fn value(self) -> u64 {
        !self.0
    }
}

/// The checksum of some bytes.
pub(crate) fn crc64(bytes: &[u8]) -> u64 {
    Crc64::new().update(bytes).value()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of the catalogue of parametrised CRC algorithms, and the definition bit by
    /// bit.
    #[test]
    fn is_crc_64_xz() {
        assert_eq!(crc64(b"123456789"), 0x995D_C9BB_DF19_39FA);
        let bytes: Vec<u8> = (0..1000u32).map(|i| (i * i / 7) as u8).collect();
        for length in [0, 1, 7, 8, 9, 63, 1000] {
            let mut crc = !0u64;
            for byte in &bytes[..length] {
                crc ^= u64::from(*byte);
                for _ in 0..8 {
                    crc = if crc & 1 == 1 { (crc >> 1) ^ POLYNOMIAL } else { crc >> 1 };
                }
            }
            assert_eq!(crc64(&bytes[..length]), !crc);
        }
    }
}
