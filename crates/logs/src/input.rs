use crate::LogError;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Chain, Cursor, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes asked of the decompressor, or of a plain file, at a time.
const CHUNK: usize = 256 * 1024;
/// Bytes asked of a compressed file at a time.
const PACKED_CHUNK: usize = 32 * 1024;

/// Text of any size, decompressed as it is read.
pub type LogInput = Box<dyn BufRead + Send>;

/// An open log file: what the thin shell around the parsers knows of files.
pub struct LogFile {
    /// The decompressed text.
    pub input: LogInput,
    /// Size on disk, bytes.
    pub size: u64,
    /// Bytes taken from disk so far; shared, for progress bars.
    pub position: Arc<AtomicU64>,
}

impl LogFile {
    /// Opens a plain, gzip or bzip2 file. The content decides, not the name.
    ///
    /// # Errors
    /// [`LogError::Open`] when the file cannot be opened or its first bytes cannot be read.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let open_error = |cause| LogError::Open { file: path.to_owned(), cause };
        let file = File::open(path).map_err(open_error)?;
        let metadata = file.metadata().map_err(open_error)?;
        if metadata.is_dir() {
            return Err(open_error(io::Error::other("is a folder, not a file")));
        }
        let position = Arc::new(AtomicU64::new(0));
        let counting = Counting { file, position: Arc::clone(&position) };
        let input = decompress(counting).map_err(open_error)?;
        Ok(LogFile { input, size: metadata.len(), position })
    }
}

/// Decompresses plain, gzip (also concatenated) or bzip2 (also multistream) input on the fly.
///
/// # Errors
/// Those of reading the first bytes.
pub fn decompress(mut raw: impl Read + Send + 'static) -> io::Result<LogInput> {
    let mut magic = Vec::with_capacity(4);
    raw.by_ref().take(4).read_to_end(&mut magic)?;
    let kind = Kind::of(&magic);
    let whole: Chain<Cursor<Vec<u8>>, _> = Cursor::new(magic).chain(raw);
    let capacity = if matches!(kind, Kind::Plain) { CHUNK } else { PACKED_CHUNK };
    let buffered = BufReader::with_capacity(capacity, whole);
    Ok(match kind {
        Kind::Plain => Box::new(buffered),
        Kind::Gzip => Box::new(BufReader::with_capacity(
            CHUNK,
            flate2::bufread::MultiGzDecoder::new(buffered),
        )),
        Kind::Bzip2 => {
            Box::new(BufReader::with_capacity(CHUNK, bzip2::bufread::MultiBzDecoder::new(buffered)))
        }
    })
}

/// Compression by the first bytes.
enum Kind {
    Plain,
    Gzip,
    Bzip2,
}

impl Kind {
    fn of(magic: &[u8]) -> Kind {
        match magic {
            [0x1f, 0x8b, ..] => Kind::Gzip,
            [b'B', b'Z', b'h', b'1'..=b'9'] => Kind::Bzip2,
            _ => Kind::Plain,
        }
    }
}

/// A file that counts what is read from it.
struct Counting {
    file: File,
    position: Arc<AtomicU64>,
}

impl Read for Counting {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        self.position.fetch_add(read as u64, Ordering::Relaxed);
        Ok(read)
    }
}
