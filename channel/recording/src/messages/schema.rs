//! Schemas of messages in MCAP files.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use tactnet_channel::{Description, FieldType, Layout};

/// Returns the `FileDescriptorSet` of all messages of a description: an MCAP schema of encoding `protobuf`.
pub(super) fn schema(described: &Description) -> Vec<u8> {
    let file = FileDescriptorProto {
        name: Some(format!("{}.proto", described.project)),
        package: Some(described.project.into()),
        message_type: described
            .messages()
            .map(|layout| message(described.project, layout))
            .collect(),
        syntax: Some("proto3".into()),
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

fn message(project: &str, layout: &Layout) -> DescriptorProto {
    let fields = layout
        .recorded()
        .into_iter()
        .map(|(number, _, field)| {
            let (mut kind, mut label) = (field.kind, Label::Optional);
            while let FieldType::Array(of, _) = kind {
                (kind, label) = (*of, Label::Repeated);
            }
            FieldDescriptorProto {
                name: Some(field.name.into()),
                number: Some(number as i32),
                label: Some(label.into()),
                r#type: Some(wire_type(kind).into()),
                type_name: kind.part().map(|part| format!(".{project}.{}", part.name)),
                json_name: Some(camel(field.name)),
                ..FieldDescriptorProto::default()
            }
        })
        .collect();
    DescriptorProto {
        name: Some(layout.name.into()),
        field: fields,
        ..DescriptorProto::default()
    }
}

fn wire_type(kind: FieldType) -> Type {
    match kind {
        FieldType::U8 | FieldType::U16 | FieldType::U32 => Type::Uint32,
        FieldType::I8 | FieldType::I16 | FieldType::I32 => Type::Int32,
        FieldType::U64 => Type::Uint64,
        FieldType::I64 => Type::Int64,
        FieldType::F32 => Type::Float,
        FieldType::F64 => Type::Double,
        FieldType::Text(_) => Type::String,
        FieldType::Packet(_) => Type::Message,
        FieldType::Array(..) => unreachable!("of an array only its values are asked for"),
    }
}

/// Converts `sensor_time_ns` to `sensorTimeNs`, its name in JSON.
fn camel(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_string();
    words.fold(first, |mut camel, word| {
        camel.extend(word.get(..1).map(str::to_ascii_uppercase));
        camel.push_str(word.get(1..).unwrap_or_default());
        camel
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The generated schemas equal those that a Protocol Buffers compiler reads from the committed files.
    #[test]
    fn descriptions_are_those_of_the_committed_files() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/proto");
        for described in [
            tactnet_skin::packets::DESCRIPTION,
            tactnet_catching_packets::packets::DESCRIPTION,
        ] {
            let file = format!("{}.proto", described.project);
            let mut compiled = protox::compile([file], [folder]).unwrap();
            compiled.file[0].source_code_info = None;
            let ours = FileDescriptorSet::decode(schema(&described).as_slice()).unwrap();
            assert_eq!(ours, compiled);
        }
    }
}
