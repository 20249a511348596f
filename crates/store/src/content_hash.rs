use crate::checksum::Crc64;

/// The hash by which a log is known again, taken piece by piece: CRC-64 and length. It tells logs
/// apart; it does not prove anything against somebody who wants two to look the same.
///
/// ```
/// use manifoldslam_store::ContentHash;
/// let hash = ContentHash::default().update(b"1234").update(b"56789");
/// assert_eq!(hash.to_text(), "crc64:995dc9bbdf1939fa:9");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ContentHash {
    crc: Crc64,
    bytes: u64,
}

impl Default for ContentHash {
    fn default() -> Self {
        ContentHash { crc: Crc64::new(), bytes: 0 }
    }
}

impl ContentHash {
    /// Takes in the next bytes.
    #[must_use]
    pub fn update(self, bytes: &[u8]) -> Self {
        ContentHash { crc: self.crc.update(bytes), bytes: self.bytes + bytes.len() as u64 }
    }

    /// The hash as it is stored.
    pub fn to_text(self) -> String {
        format!("crc64:{:016x}:{}", self.crc.value(), self.bytes)
    }
}
