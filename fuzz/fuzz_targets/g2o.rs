//! Any bytes as a pose graph; what was read is written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use logs::g2o::{Graph, read_g2o, write_g2o};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let name = Path::new("fuzz");
    let file = read_g2o(data, name);
    let mut text = Vec::new();
    let counts = match &file.graph {
        Graph::Plane(graph) => {
            write_g2o(&mut text, graph).expect("memory can be written");
            (graph.nodes().len(), graph.edges().len())
        }
        Graph::Space(graph) => {
            write_g2o(&mut text, graph).expect("memory can be written");
            (graph.nodes().len(), graph.edges().len())
        }
    };
    let again = read_g2o(&text[..], name);
    assert!(!again.is_lossy(), "what was written can be read: {again:?}");
    let counts_again = match &again.graph {
        Graph::Plane(graph) => (graph.nodes().len(), graph.edges().len()),
        Graph::Space(graph) => (graph.nodes().len(), graph.edges().len()),
    };
    assert_eq!(counts, counts_again);
    let mut text_again = Vec::new();
    match &again.graph {
        Graph::Plane(graph) => write_g2o(&mut text_again, graph),
        Graph::Space(graph) => write_g2o(&mut text_again, graph),
    }
    .expect("memory can be written");
    assert_eq!(text, text_again, "writing is settled after one round");
});
