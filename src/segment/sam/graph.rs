//! An ONNX model as a graph of named values: enough of the format (`onnx.proto`) to see what depends on what and to cut
//! the graph. What gprop does not look into stays as the bytes it was.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use prost::Message;

/// Nodes that have other graphs inside, or whose result's shape depends on their input's values.
const OPAQUE_OPERATORS: [&str; 7] = ["If", "Loop", "Scan", "NonZero", "Unique", "Compress", "NonMaxSuppression"];

/// `ModelProto`.
#[derive(Clone, PartialEq, Message)]
pub struct Model {
    #[prost(int64, optional, tag = "1")]
    ir_version: Option<i64>,
    #[prost(bytes = "vec", repeated, tag = "8")]
    opset_import: Vec<Vec<u8>>,
    #[prost(message, optional, tag = "7")]
    graph: Option<Graph>,
    #[prost(bytes = "vec", repeated, tag = "25")]
    functions: Vec<Vec<u8>>,
}

/// `GraphProto`.
#[derive(Clone, PartialEq, Message)]
struct Graph {
    #[prost(message, repeated, tag = "1")]
    node: Vec<Node>,
    #[prost(string, optional, tag = "2")]
    name: Option<String>,
    #[prost(bytes = "vec", repeated, tag = "5")]
    initializer: Vec<Vec<u8>>,
    #[prost(message, repeated, tag = "11")]
    input: Vec<ValueInfo>,
    #[prost(message, repeated, tag = "12")]
    output: Vec<ValueInfo>,
    #[prost(bytes = "vec", repeated, tag = "15")]
    sparse_initializer: Vec<Vec<u8>>,
}

/// `NodeProto`. Values are named by strings; an empty name is an optional input left out.
#[derive(Clone, PartialEq, Message)]
struct Node {
    #[prost(string, repeated, tag = "1")]
    input: Vec<String>,
    #[prost(string, repeated, tag = "2")]
    output: Vec<String>,
    #[prost(string, optional, tag = "3")]
    name: Option<String>,
    #[prost(string, optional, tag = "4")]
    op_type: Option<String>,
    #[prost(bytes = "vec", repeated, tag = "5")]
    attribute: Vec<Vec<u8>>,
    #[prost(string, optional, tag = "7")]
    domain: Option<String>,
    #[prost(string, optional, tag = "8")]
    overload: Option<String>,
}

/// `ValueInfoProto`.
#[derive(Clone, PartialEq, Message)]
struct ValueInfo {
    #[prost(string, optional, tag = "1")]
    name: Option<String>,
    #[prost(message, optional, tag = "2")]
    value_type: Option<ValueType>,
}

/// `TypeProto` of a tensor.
#[derive(Clone, PartialEq, Message)]
struct ValueType {
    #[prost(message, optional, tag = "1")]
    tensor: Option<TensorType>,
}

/// `TypeProto.Tensor`.
#[derive(Clone, PartialEq, Message)]
struct TensorType {
    #[prost(int32, optional, tag = "1")]
    element: Option<i32>,
    #[prost(message, optional, tag = "2")]
    shape: Option<Shape>,
}

/// `TensorShapeProto`.
#[derive(Clone, PartialEq, Message)]
struct Shape {
    #[prost(message, repeated, tag = "1")]
    dimension: Vec<Dimension>,
}

/// `TensorShapeProto.Dimension`: a number, or none where it is dynamic.
#[derive(Clone, PartialEq, Message)]
struct Dimension {
    #[prost(int64, optional, tag = "1")]
    value: Option<i64>,
}

/// `TensorProto` with raw little-endian content.
#[derive(Clone, PartialEq, Message)]
struct Tensor {
    #[prost(int64, repeated, packed = "false", tag = "1")]
    dimensions: Vec<i64>,
    #[prost(int32, optional, tag = "2")]
    element: Option<i32>,
    #[prost(string, optional, tag = "8")]
    name: Option<String>,
    #[prost(bytes = "vec", optional, tag = "9")]
    raw: Option<Vec<u8>>,
}

/// `TensorProto.DataType`: the kinds of numbers that a decoder's intermediate values are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Element {
    Float32 = 1,
    Int32 = 6,
    Int64 = 7,
    Bool = 9,
}

/// A tensor that is to be part of a model.
#[derive(Debug, Clone)]
pub struct Constant {
    pub name: String,
    pub shape: Vec<i64>,
    pub element: Element,
    /// Little-endian.
    pub bytes: Vec<u8>,
}

/// A float input of fixed shape.
#[derive(Debug, Clone)]
pub struct Input {
    pub name: String,
    pub shape: Vec<i64>,
}

impl Model {
    /// Reads a model; `None` where the bytes are none, or hold no graph.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        Self::decode(bytes).ok().filter(|model| model.graph.is_some())
    }

    /// The dimensions of an input, `None` for a dynamic one; and no list at all where it does not say.
    pub fn input_shape(&self, name: &str) -> Option<Vec<Option<i64>>> {
        let input = self.graph().input.iter().find(|input| input.name() == name)?;
        let shape = input.value_type.as_ref()?.tensor.as_ref()?.shape.as_ref()?;
        Some(shape.dimension.iter().map(|dimension| dimension.value).collect())
    }

    pub fn input_names(&self) -> Vec<&str> {
        self.graph().input.iter().map(ValueInfo::name).collect()
    }

    pub fn output_names(&self) -> Vec<&str> {
        self.graph().output.iter().map(ValueInfo::name).collect()
    }

    /// Whether what depends on what can be told from the nodes' names alone.
    pub fn is_plain(&self) -> bool {
        let nodes = &self.graph().node;
        self.functions.is_empty() && nodes.iter().all(|node| !OPAQUE_OPERATORS.contains(&node.op_type()))
    }

    /// The values that `name` is computed from, nearest first, itself included, at most `count`. The search does not pass
    /// through an `ArgMax`: what only decides which values are taken is none of them.
    pub fn ancestors<'a>(&'a self, name: &'a str, count: usize) -> Vec<&'a str> {
        let producers = self.producers();
        let (mut found, mut open) = (Vec::new(), VecDeque::from([name]));
        while let Some(value) = open.pop_front() {
            if found.len() == count || found.contains(&value) {
                continue;
            }
            let Some(node) = producers.get(value) else { continue };
            found.push(value);
            if node.op_type() != "ArgMax" {
                open.extend(node.input.iter().map(String::as_str).filter(|name| !name.is_empty()));
            }
        }
        found
    }

    /// The values that change with those of `sources` while all shapes stay as they are. A `Shape` passes nothing on.
    pub fn dependents(&self, sources: &[&str]) -> BTreeSet<&str> {
        self.reached(sources, |node| node.op_type() != "Shape")
    }

    /// The values that change with those of `sources` or with their shapes.
    pub fn dependents_with_shapes(&self, sources: &[&str]) -> BTreeSet<&str> {
        self.reached(sources, |_| true)
    }

    /// What the nodes in `upper` take from outside of it: values of `all` that are not in `upper`, in order of use; only of
    /// nodes that `outputs` need.
    pub fn border<'a>(&'a self, outputs: &[&str], upper: &BTreeSet<&str>, all: &BTreeSet<&str>) -> Vec<&'a str> {
        let needed = self.needed_nodes(outputs, &BTreeSet::new());
        let mut border = Vec::new();
        for (node, _) in self.graph().node.iter().zip(needed).filter(|(_, needed)| *needed) {
            if !node.output.iter().any(|output| upper.contains(output.as_str())) {
                continue;
            }
            for input in node.input.iter().map(String::as_str) {
                if all.contains(input) && !upper.contains(input) && !border.contains(&input) {
                    border.push(input);
                }
            }
        }
        border
    }

    /// The model with these outputs only, and, where it is [plain](Self::is_plain), only the nodes that they need.
    pub fn with_outputs(&self, outputs: &[&str]) -> Vec<u8> {
        self.cut(outputs, &[], &[])
    }

    /// As [`Self::with_outputs`], with some values given instead of computed: as `inputs`, which replace those of the
    /// same name, or as `constants`.
    pub fn cut(&self, outputs: &[&str], inputs: &[Input], constants: &[Constant]) -> Vec<u8> {
        let given_names = inputs.iter().map(|input| input.name.as_str());
        let given: BTreeSet<&str> = given_names.chain(constants.iter().map(|value| value.name.as_str())).collect();
        let graph = self.graph();
        // A graph inside a node may use any value outside of it.
        let keep_all = !self.is_plain();
        let needed = if keep_all { vec![true; graph.node.len()] } else { self.needed_nodes(outputs, &given) };
        let node: Vec<Node> =
            graph.node.iter().zip(needed).filter(|(_, needed)| *needed).map(|(node, _)| node.clone()).collect();
        let used: BTreeSet<&str> =
            node.iter().flat_map(|node| &node.input).map(String::as_str).chain(outputs.iter().copied()).collect();
        let is_kept = |name: &str| (keep_all || used.contains(name)) && !given.contains(name);
        let own_inputs = graph.input.iter().filter(|input| is_kept(input.name()));
        let is_kept_tensor = |tensor: &&Vec<u8>| Tensor::decode(tensor.as_slice()).is_ok_and(|t| is_kept(t.name()));
        let own_constants = graph.initializer.iter().filter(is_kept_tensor).cloned();
        let new_graph = Graph {
            input: own_inputs.cloned().chain(inputs.iter().map(ValueInfo::of)).collect(),
            output: outputs.iter().map(|name| ValueInfo::untyped(name)).collect(),
            initializer: own_constants.chain(constants.iter().map(|value| value.to_tensor().encode_to_vec())).collect(),
            name: graph.name.clone(),
            sparse_initializer: graph.sparse_initializer.clone(),
            node,
        };
        Self { graph: Some(new_graph), ..self.clone() }.encode_to_vec()
    }

    fn graph(&self) -> &Graph {
        self.graph.as_ref().expect("a parsed model has a graph")
    }

    fn producers(&self) -> BTreeMap<&str, &Node> {
        let nodes = self.graph().node.iter();
        nodes.flat_map(|node| node.output.iter().map(move |output| (output.as_str(), node))).collect()
    }

    /// Nodes stand after those that they read from, as the format demands.
    fn reached(&self, sources: &[&str], passes_on: impl Fn(&Node) -> bool) -> BTreeSet<&str> {
        let mut reached = BTreeSet::new();
        for node in self.graph().node.iter().filter(|node| passes_on(node)) {
            let is_reached = |input: &String| sources.contains(&input.as_str()) || reached.contains(input.as_str());
            if node.input.iter().any(is_reached) {
                reached.extend(node.output.iter().map(String::as_str));
            }
        }
        reached
    }

    /// Which nodes are needed for `outputs` where the values `given` are there already.
    fn needed_nodes(&self, outputs: &[&str], given: &BTreeSet<&str>) -> Vec<bool> {
        let mut wanted: BTreeSet<&str> = outputs.iter().copied().filter(|name| !given.contains(name)).collect();
        let mut needed = vec![false; self.graph().node.len()];
        for (node, needed) in self.graph().node.iter().zip(&mut needed).rev() {
            *needed = node.output.iter().any(|output| wanted.contains(output.as_str()));
            if *needed {
                wanted.extend(node.input.iter().map(String::as_str).filter(|name| !given.contains(name)));
            }
        }
        needed
    }
}

impl ValueInfo {
    fn of(input: &Input) -> Self {
        let dimension = input.shape.iter().map(|&value| Dimension { value: Some(value) }).collect();
        let tensor = TensorType { element: Some(Element::Float32 as i32), shape: Some(Shape { dimension }) };
        Self { name: Some(input.name.clone()), value_type: Some(ValueType { tensor: Some(tensor) }) }
    }

    /// ONNX Runtime finds the type out by itself.
    fn untyped(name: &str) -> Self {
        Self { name: Some(name.to_owned()), value_type: None }
    }
}

impl Constant {
    fn to_tensor(&self) -> Tensor {
        Tensor {
            dimensions: self.shape.clone(),
            element: Some(self.element as i32),
            name: Some(self.name.clone()),
            raw: Some(self.bytes.clone()),
        }
    }
}
