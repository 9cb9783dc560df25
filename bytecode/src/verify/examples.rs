//! One container for each rule that breaks it, as assembly text: files of the verifier's own tests, so that what `khz explain` shows is
//! rejected as it says. The match has no `_`: a new rule does not compile before it has a row here.

use super::Rule;

macro_rules! examples {
    ($($rule:ident $file:literal),* $(,)?) => {
        impl Rule {
            /// Assembly text (`docs/assembly.md`) of a container that is rejected by this rule, with the comment `; error CODE` where it is
            /// broken. [`Rule::AnalysisSize`] has none: only a very large text breaks it.
            #[must_use]
            pub fn example(self) -> Option<&'static str> {
                match self {
                    $(Rule::$rule => Some(include_str!(concat!("../../tests/verifier/", $file, ".khza"))),)*
                    Rule::AnalysisSize => None,
                }
            }
        }
    };
}

examples! {
    TypeOrder "v0001_type_order",
    TypeDepth "v0002_type_depth",
    RecordLayout "v0003_alignment",
    FieldLayout "v0004_overlap",
    TypeSize "v0005_type_size",
    ArrayBounds "v0006_no_dimension",
    ArrayStride "v0007_array_stride",
    BlockBase "v0008_base_is_no_block",
    BlockAddress "v0009_empty_block",
    BlockMethods "v0010_order",
    UnionWidth "v0011_union_width",
    MethodSignature "v0013_method_signature",
    DataLayout "v0020_overlap",
    DataType "v0021_missing_type",
    ProgramType "v0022_program_type",
    BlockInstances "v0023_not_listed",
    InitLayout "v0024_overlap",
    InitValue "v0025_bool_slot",
    RetainLayout "v0026_part_of_slot",
    MemoryBudget "v0027_memory_budget",
    ConstantNan "v0028_constant_nan",
    HeaderLimits "v0029_header_limits",
    SharedGlobals "v0030_shared_globals",
    TaskIds "v0040_task_ids",
    InstanceIds "v0041_instance_ids",
    InstanceTask "v0042_instance_task",
    InstanceEntry "v0043_instance_entry",
    InstancePartition "v0044_overlap",
    InstanceSlots "v0045_instance_slots",
    TaskInterval "v0046_no_interval",
    TaskExtensions "v0047_task_extensions",
    SingleSource "v0048_event_without_single",
    SystemVariables "v0049_system_variables",
    StartFunctions "v0050_start_functions",
    FunctionOwner "v0060_function_owner",
    FunctionLocals "v0061_parameters",
    FunctionFrame "v0062_function_frame",
    ForControl "v0063_input",
    ForSlots "v0064_shared_slot",
    InstructionBoundary "v0070_cut",
    JumpTarget "v0071_jump_target",
    BackwardJump "v0072_backward_jump",
    ForwardOnly "v0073_for_exit",
    Unreachable "v0074_unreachable",
    FallOff "v0075_fall_off",
    ForPair "v0076_no_enter",
    ForHeader "v0077_for_header",
    LoopDepth "v0078_loop_depth",
    StackUnderflow "v0080_stack_underflow",
    StackDepth "v0081_stack_depth",
    OperandType "v0082_operand_type",
    MergeStack "v0083_merge_stack",
    ReturnStack "v0084_too_little",
    OperandIndex "v0085_slot",
    PlaceOwner "v0086_program_slot",
    TypedAccess "v0087_behind",
    ImageBounds "v0088_outside",
    BitPlace "v0089_bit_place",
    InputWrite "v0090_store",
    ConstantWrite "v0091_constant_write",
    ReadOnlyReference "v0092_constant",
    ReferenceTarget "v0093_load",
    UnassignedReference "v0094_one_path",
    StringOperand "v0095_string_operand",
    CheckTarget "v0096_check_target",
    CheckKind "v0097_width",
    CallOwner "v0110_call_owner",
    Recursion "v0111_recursion",
    CallDepth "v0112_call_depth",
    FrameBytes "v0113_frame_bytes",
}
