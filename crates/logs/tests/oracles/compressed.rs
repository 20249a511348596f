use bzip2::write::BzEncoder;
use flate2::write::GzEncoder;
use manifoldslam_logs::{CarmenReader, LogError, LogFile, ReadOptions, decompress};
use std::io::{Cursor, Read, Write};
use std::sync::atomic::Ordering;

fn log(scans: std::ops::Range<usize>) -> Vec<u8> {
    scans
        .map(|i| {
            let ranges: String =
                (0..180).map(|k| format!("{}.{:02} ", k % 7, (i * k) % 100)).collect();
            format!("FLASER 180 {ranges}0 0 0 {i} 0 0 {i}.5 h 0\n")
        })
        .collect::<String>()
        .into_bytes()
}

fn gzip(text: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(text).unwrap();
    encoder.finish().unwrap()
}

fn bzip2(text: &[u8]) -> Vec<u8> {
    let mut encoder = BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    encoder.write_all(text).unwrap();
    encoder.finish().unwrap()
}

fn expand(bytes: Vec<u8>) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    decompress(Cursor::new(bytes))?.read_to_end(&mut out).map(|_| out)
}

#[test]
fn the_content_decides_and_streams_may_be_concatenated() {
    let (first, second) = (log(0..50), log(50..400));
    let whole = [first.clone(), second.clone()].concat();
    assert_eq!(expand(whole.clone()).unwrap(), whole);
    assert_eq!(expand(gzip(&whole)).unwrap(), whole);
    assert_eq!(expand(bzip2(&whole)).unwrap(), whole);
    assert_eq!(expand([gzip(&first), gzip(&second)].concat()).unwrap(), whole);
    assert_eq!(expand([bzip2(&first), bzip2(&second)].concat()).unwrap(), whole);
}

#[test]
fn short_input_is_plain_text() {
    for text in [&b""[..], b"F", b"BZ", b"BZh", b"\x1f", b"#\n", b"BZhello"] {
        assert_eq!(expand(text.to_vec()).unwrap(), text);
    }
}

#[test]
fn a_damaged_archive_gives_its_readable_part_and_the_line() {
    for (name, pack) in [("gzip", gzip as fn(&[u8]) -> Vec<u8>), ("bzip2", bzip2)] {
        let packed = pack(&log(0..400));
        let mut cut = packed.clone();
        cut.truncate(packed.len() * 3 / 4);
        let mut reader =
            CarmenReader::new(decompress(Cursor::new(cut)).unwrap(), ReadOptions::default());
        let scans = reader.by_ref().count();
        let report = reader.finish();
        assert!(scans > 0 && scans < 400, "{name}: {scans}");
        let Some(LogError::Read { line, .. }) = report.failure else {
            panic!("{name}: {report:?}")
        };
        assert!(line >= scans as u64, "{name}");
    }
}

#[test]
fn a_bomb_is_read_in_bounded_memory() {
    // 64 MiB of zeros pack into some ten kilobytes, and are one line without end.
    let bomb = gzip(&vec![0; 64 << 20]);
    let mut reader =
        CarmenReader::new(decompress(Cursor::new(bomb)).unwrap(), ReadOptions::default());
    assert_eq!(reader.by_ref().count(), 0);
    assert_eq!(reader.finish().dropped_count, 1);
}

#[test]
fn files_are_opened_and_counted_and_faults_named() {
    let folder = std::env::temp_dir().join(format!("manifoldslam-logs-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("named.txt");
    let packed = bzip2(&log(0..20));
    std::fs::write(&path, &packed).unwrap();
    let mut file = LogFile::open(&path).unwrap();
    let mut text = Vec::new();
    file.input.read_to_end(&mut text).unwrap();
    assert_eq!((text, file.size), (log(0..20), packed.len() as u64));
    assert_eq!(file.position.load(Ordering::Relaxed), packed.len() as u64);
    for bad in [folder.join("missing.clf"), folder.clone()] {
        let Err(error) = LogFile::open(&bad) else { panic!("{bad:?} was opened") };
        assert!(error.to_string().contains(bad.to_str().unwrap()), "{error}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
