//! The files beside a model that hold its weights (ONNX's *external data*): a model of more than 2 GB cannot hold them
//! itself, and smaller ones may be saved in this way.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use prost::Message;
use sha2::{Digest, Sha256};

use crate::files;
use crate::workdir::sha256_of_file;

/// `ModelProto`. Here and below, decoding skips the other fields, among them the weights in the model itself.
#[derive(Clone, PartialEq, Message)]
struct Model {
    #[prost(message, optional, tag = "7")]
    graph: Option<Graph>,
}

/// `GraphProto`.
#[derive(Clone, PartialEq, Message)]
struct Graph {
    #[prost(message, repeated, tag = "1")]
    node: Vec<Node>,
    #[prost(message, repeated, tag = "5")]
    initializer: Vec<Tensor>,
}

/// `NodeProto`.
#[derive(Clone, PartialEq, Message)]
struct Node {
    #[prost(message, repeated, tag = "5")]
    attribute: Vec<Attribute>,
}

/// `AttributeProto`.
#[derive(Clone, PartialEq, Message)]
struct Attribute {
    #[prost(message, optional, tag = "5")]
    tensor: Option<Tensor>,
    #[prost(message, optional, boxed, tag = "6")]
    graph: Option<Box<Graph>>,
    #[prost(message, repeated, tag = "10")]
    tensors: Vec<Tensor>,
    #[prost(message, repeated, tag = "11")]
    graphs: Vec<Graph>,
}

/// `TensorProto`.
#[derive(Clone, PartialEq, Message)]
struct Tensor {
    #[prost(message, repeated, tag = "13")]
    external_data: Vec<Entry>,
}

/// `StringStringEntryProto`. The file is the value of the key [`LOCATION`], relative to the model's folder.
#[derive(Clone, PartialEq, Message)]
struct Entry {
    #[prost(string, optional, tag = "1")]
    key: Option<String>,
    #[prost(string, optional, tag = "2")]
    value: Option<String>,
}

const LOCATION: &str = "location";

/// SHA-256 of the model at `path`; if it has weights in other files, of these as well. Other files that cannot be read
/// are left out: ONNX Runtime reports them when it loads the model.
pub fn digest(path: &Path) -> io::Result<[u8; 32]> {
    let model = files::read_large(path)?;
    let own: [u8; 32] = Sha256::digest(&model).into();
    let others: Vec<[u8; 32]> =
        files_beside(path, &model).iter().filter_map(|file| sha256_of_file(file).ok()).collect();
    if others.is_empty() {
        return Ok(own);
    }
    let hasher = others.iter().fold(Sha256::new().chain_update(own), Sha256::chain_update);
    Ok(hasher.finalize().into())
}

/// Size of the model at `path` in bytes, with its weights in other files.
pub fn size(path: &Path) -> io::Result<u64> {
    let model = files::read_large(path)?;
    let others = files_beside(path, &model);
    let of_others: u64 = others.iter().filter_map(|file| fs::metadata(file).ok()).map(|found| found.len()).sum();
    Ok(model.len() as u64 + of_others)
}

/// The files that hold weights of the model whose bytes, read from `path`, are `model`. None if the bytes are not a
/// model, which ONNX Runtime reports.
fn files_beside(path: &Path, model: &[u8]) -> BTreeSet<PathBuf> {
    let model = Model::decode(model).unwrap_or_default();
    let mut tensors = Vec::new();
    if let Some(graph) = &model.graph {
        collect_tensors(graph, &mut tensors);
    }
    let entries = tensors.into_iter().flat_map(|tensor| &tensor.external_data);
    let locations = entries.filter(|entry| entry.key() == LOCATION);
    locations.map(|entry| path.with_file_name(entry.value())).collect()
}

/// The tensors of a graph and of the graphs inside it.
fn collect_tensors<'a>(graph: &'a Graph, found: &mut Vec<&'a Tensor>) {
    found.extend(graph.initializer.iter());
    for attribute in graph.node.iter().flat_map(|node| &node.attribute) {
        found.extend(attribute.tensor.iter().chain(&attribute.tensors));
        for inner in attribute.graph.as_deref().into_iter().chain(&attribute.graphs) {
            collect_tensors(inner, found);
        }
    }
}

/// The bytes of a model whose only weights are in the file `location`.
#[cfg(test)]
pub fn model_with_weights_in(location: &str) -> Vec<u8> {
    let graph = Graph { initializer: vec![tests::tensor(location)], node: Vec::new() };
    Model { graph: Some(graph) }.encode_to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tensor whose values are in the file `location`.
    pub(super) fn tensor(location: &str) -> Tensor {
        let entry = |key: &str, value: &str| Entry { key: Some(key.to_owned()), value: Some(value.to_owned()) };
        Tensor { external_data: vec![entry("offset", "0"), entry(LOCATION, location)] }
    }

    /// A model in `folder` with weights in `weights.bin`, which two tensors share, and in `inner.bin`.
    fn model(folder: &Path) -> PathBuf {
        let inner = Graph { initializer: vec![tensor("inner.bin")], node: Vec::new() };
        let attribute = Attribute { graph: Some(Box::new(inner)), ..Attribute::default() };
        let graph = Graph {
            initializer: vec![tensor("weights.bin"), Tensor::default(), tensor("weights.bin")],
            node: vec![Node { attribute: vec![attribute] }],
        };
        let path = folder.join("encoder.onnx");
        fs::write(&path, Model { graph: Some(graph) }.encode_to_vec()).unwrap();
        path
    }

    #[test]
    fn weights_in_other_files_belong_to_the_model() {
        let folder = tempfile::tempdir().unwrap();
        let path = model(folder.path());
        let own = fs::metadata(&path).unwrap().len();
        let alone = sha256_of_file(&path).unwrap();
        assert_eq!((digest(&path).unwrap(), size(&path).unwrap()), (alone, own), "there are no other files yet");
        let mut digests = vec![alone];
        for (name, bytes) in [("weights.bin", "1234"), ("weights.bin", "1235"), ("inner.bin", "123456")] {
            fs::write(folder.path().join(name), bytes).unwrap();
            digests.push(digest(&path).unwrap());
        }
        assert_eq!(size(&path).unwrap(), own + 4 + 6);
        let distinct: BTreeSet<[u8; 32]> = digests.iter().copied().collect();
        assert_eq!(distinct.len(), digests.len(), "{digests:?}");
    }

    #[test]
    fn a_file_that_is_no_model_is_hashed_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("junk.onnx");
        fs::write(&path, "not a model").unwrap();
        assert_eq!(digest(&path).unwrap(), sha256_of_file(&path).unwrap());
        assert_eq!(size(&path).unwrap(), 11);
    }
}
