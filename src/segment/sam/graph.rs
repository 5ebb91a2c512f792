//! An ONNX model as a graph of named values: enough of the format (`onnx.proto`) to find values and constants in it,
//! and to make other values its outputs. Parts that gprop does not read are kept as raw bytes.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use prost::Message;

/// Operators that contain other graphs, which may use any value outside of them.
const OPERATORS_WITH_GRAPHS: [&str; 3] = ["If", "Loop", "Scan"];
/// `TensorProto.DataType.FLOAT`.
const FLOAT: i32 = 1;

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

/// `NodeProto`. Values are named by strings; an empty name stands for an omitted optional input.
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

/// `TensorShapeProto.Dimension`: a number, or none if it is dynamic.
#[derive(Clone, PartialEq, Message)]
struct Dimension {
    #[prost(int64, optional, tag = "1")]
    value: Option<i64>,
}

/// `TensorProto` of floats.
#[derive(Clone, PartialEq, Message)]
struct Tensor {
    #[prost(int64, repeated, packed = "false", tag = "1")]
    dimensions: Vec<i64>,
    #[prost(int32, optional, tag = "2")]
    element: Option<i32>,
    #[prost(float, repeated, tag = "4")]
    floats: Vec<f32>,
    #[prost(string, optional, tag = "8")]
    name: Option<String>,
    /// Little-endian; if this is missing, `floats` is used.
    #[prost(bytes = "vec", optional, tag = "9")]
    raw: Option<Vec<u8>>,
}

/// The float constants of a model, by name.
pub struct Constants(BTreeMap<String, Floats>);

struct Floats {
    shape: Vec<usize>,
    values: Vec<f32>,
}

impl Model {
    /// Reads a model; `None` if the bytes are not a model or hold no graph.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        Self::decode(bytes).ok().filter(|model| model.graph.is_some())
    }

    /// The dimensions of an input, `None` for a dynamic one; `None` instead of a list if the model does not declare
    /// them.
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

    /// The values that `name` is computed from, nearest first, itself included, at most `count`. The search does not
    /// pass through an `ArgMax`, since its inputs only decide which values are taken.
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

    /// The inputs of the operator of this kind that produces `value`.
    pub fn producer(&self, value: &str, operator: &str) -> Option<&[String]> {
        self.nodes(operator).find(|node| node.output.iter().any(|output| output == value)).map(|node| &*node.input)
    }

    /// The inputs of the first operator of this kind that consumes `value`.
    pub fn consumer(&self, value: &str, operator: &str) -> Option<&[String]> {
        self.nodes(operator).find(|node| node.input.iter().any(|input| input == value)).map(|node| &*node.input)
    }

    /// The inputs of the operators of this kind that depend on `value`, in the order of the graph.
    pub fn consumers_after<'a>(&'a self, value: &str, operator: &'a str) -> impl Iterator<Item = &'a [String]> {
        let mut reached = BTreeSet::from([value]);
        // Nodes come after those that they read from, as the format requires.
        for node in &self.graph().node {
            if node.input.iter().any(|input| reached.contains(input.as_str())) {
                reached.extend(node.output.iter().map(String::as_str));
            }
        }
        let reached: BTreeSet<String> = reached.into_iter().map(str::to_owned).collect();
        let nodes = self.nodes(operator).filter(move |node| node.input.iter().any(|input| reached.contains(input)));
        nodes.map(|node| &*node.input)
    }

    /// All float constants, decoded.
    pub fn constants(&self) -> Constants {
        let tensors = self.graph().initializer.iter().filter_map(|bytes| Tensor::decode(bytes.as_slice()).ok());
        Constants(tensors.filter_map(Tensor::into_floats).collect())
    }

    /// The model reduced to these outputs and the nodes that they need.
    pub fn with_outputs(&self, outputs: &[&str]) -> Vec<u8> {
        let graph = self.graph();
        let keep_all = graph.node.iter().any(|node| OPERATORS_WITH_GRAPHS.contains(&node.op_type()));
        let needed = if keep_all { vec![true; graph.node.len()] } else { self.needed_nodes(outputs) };
        let node: Vec<Node> =
            graph.node.iter().zip(needed).filter(|(_, needed)| *needed).map(|(node, _)| node.clone()).collect();
        let used: BTreeSet<&str> =
            node.iter().flat_map(|node| &node.input).map(String::as_str).chain(outputs.iter().copied()).collect();
        let is_kept = |name: &str| keep_all || used.contains(name);
        let is_kept_tensor = |tensor: &&Vec<u8>| Tensor::decode(tensor.as_slice()).is_ok_and(|t| is_kept(t.name()));
        let new_graph = Graph {
            input: graph.input.iter().filter(|input| is_kept(input.name())).cloned().collect(),
            output: outputs.iter().map(|name| ValueInfo::untyped(name)).collect(),
            initializer: graph.initializer.iter().filter(is_kept_tensor).cloned().collect(),
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

    fn nodes(&self, operator: &str) -> impl Iterator<Item = &Node> {
        self.graph().node.iter().filter(move |node| node.op_type() == operator)
    }

    /// For each node, whether it is needed for `outputs`.
    fn needed_nodes(&self, outputs: &[&str]) -> Vec<bool> {
        let mut wanted: BTreeSet<&str> = outputs.iter().copied().collect();
        let mut needed = vec![false; self.graph().node.len()];
        for (node, needed) in self.graph().node.iter().zip(&mut needed).rev() {
            *needed = node.output.iter().any(|output| wanted.contains(output.as_str()));
            if *needed {
                wanted.extend(node.input.iter().map(String::as_str));
            }
        }
        needed
    }
}

impl Constants {
    /// The constant with this name, if it has this shape.
    pub fn get(&self, name: &str, shape: &[usize]) -> Option<&[f32]> {
        self.0.get(name).filter(|floats| floats.shape == shape).map(|floats| &*floats.values)
    }

    /// The name with this ending.
    pub fn name_ending_in(&self, ending: &str) -> Option<&str> {
        self.0.keys().map(String::as_str).find(|name| name.ends_with(ending))
    }
}

impl ValueInfo {
    /// An output without a type; ONNX Runtime infers it.
    fn untyped(name: &str) -> Self {
        Self { name: Some(name.to_owned()), value_type: None }
    }
}

impl Tensor {
    /// Its name and values, if these are floats.
    fn into_floats(self) -> Option<(String, Floats)> {
        let (name, element) = (self.name().to_owned(), self.element());
        let shape = self.dimensions.iter().map(|&side| usize::try_from(side).ok()).collect::<Option<Vec<usize>>>()?;
        let values = match self.raw {
            Some(raw) => raw.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect(),
            None => self.floats,
        };
        let count = shape.iter().try_fold(1_usize, |count, side| count.checked_mul(*side));
        let is_whole = element == FLOAT && count == Some(values.len());
        is_whole.then_some((name, Floats { shape, values }))
    }
}
