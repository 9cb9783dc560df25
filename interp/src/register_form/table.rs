//! The rows that the register form adds to the numeric rows of the instruction table: scalar accesses and fused branches.
//!
//! [`for_each_operation!`] hands all of them, with the numeric rows in front, to one macro. The operation codes, what the
//! translation looks up, and the dispatch are derived from that, so a code without a handler does not compile.

/// Hands all rows to `$callback!`: `[numeric rows] [accesses] [canonical float loads] [comparisons] [on an element] [sums]`.
///
/// - numeric row: as in [`khz_bytecode::for_each_numeric!`]; `Variant` takes its operands from registers, `function` (as a name of an
///   operation) takes its last operand from the operation itself;
/// - access: `(Storage, type, LoadImage, LoadBased, LoadElementImage, LoadElementBased, LoadPlane, LoadPlaneBased,
///   StoreImage, ...)`. *Image*: the place counts from the image's start; *based*: from a register; *element*: of an array of one
///   dimension; *plane*: of two;
/// - canonical float load: the six loads of an access, where any NaN may stand;
/// - comparison: `(numeric variant, function, [operands], If, Unless, IfConst, UnlessConst)`;
/// - on an element: `(numeric variant, function, type, load of an element, of a plane's, the function on such an element as its last
///   operand, on a plane's, whether operands may change places)`;
/// - sum: `(Add variant, add, multiply, type, product with an element, with a plane's, sum with that product, with a plane's)`.
macro_rules! for_each_operation {
    (@own $callback:ident, [$($numeric:tt),*]) => {
        $callback! {
            [$($numeric),*]
            [
                (Bool, bool, LoadBool, LoadBasedBool, LoadElementBool, LoadElementBasedBool,
                 LoadPlaneBool, LoadPlaneBasedBool, StoreBool, StoreBasedBool, StoreElementBool, StoreElementBasedBool, StorePlaneBool, StorePlaneBasedBool, StoreConstBool, StoreBasedConstBool),
                (I8, i8, LoadI8, LoadBasedI8, LoadElementI8, LoadElementBasedI8,
                 LoadPlaneI8, LoadPlaneBasedI8, StoreI8, StoreBasedI8, StoreElementI8, StoreElementBasedI8, StorePlaneI8, StorePlaneBasedI8, StoreConstI8, StoreBasedConstI8),
                (U8, u8, LoadU8, LoadBasedU8, LoadElementU8, LoadElementBasedU8,
                 LoadPlaneU8, LoadPlaneBasedU8, StoreU8, StoreBasedU8, StoreElementU8, StoreElementBasedU8, StorePlaneU8, StorePlaneBasedU8, StoreConstU8, StoreBasedConstU8),
                (I16, i16, LoadI16, LoadBasedI16, LoadElementI16, LoadElementBasedI16,
                 LoadPlaneI16, LoadPlaneBasedI16, StoreI16, StoreBasedI16, StoreElementI16, StoreElementBasedI16, StorePlaneI16, StorePlaneBasedI16, StoreConstI16, StoreBasedConstI16),
                (U16, u16, LoadU16, LoadBasedU16, LoadElementU16, LoadElementBasedU16,
                 LoadPlaneU16, LoadPlaneBasedU16, StoreU16, StoreBasedU16, StoreElementU16, StoreElementBasedU16, StorePlaneU16, StorePlaneBasedU16, StoreConstU16, StoreBasedConstU16),
                (I32, i32, LoadI32, LoadBasedI32, LoadElementI32, LoadElementBasedI32,
                 LoadPlaneI32, LoadPlaneBasedI32, StoreI32, StoreBasedI32, StoreElementI32, StoreElementBasedI32, StorePlaneI32, StorePlaneBasedI32, StoreConstI32, StoreBasedConstI32),
                (I64, i64, LoadI64, LoadBasedI64, LoadElementI64, LoadElementBasedI64,
                 LoadPlaneI64, LoadPlaneBasedI64, StoreI64, StoreBasedI64, StoreElementI64, StoreElementBasedI64, StorePlaneI64, StorePlaneBasedI64, StoreConstI64, StoreBasedConstI64),
                (F32, f32, LoadF32, LoadBasedF32, LoadElementF32, LoadElementBasedF32,
                 LoadPlaneF32, LoadPlaneBasedF32, StoreF32, StoreBasedF32, StoreElementF32, StoreElementBasedF32, StorePlaneF32, StorePlaneBasedF32, StoreConstF32, StoreBasedConstF32),
                (F64, f64, LoadF64, LoadBasedF64, LoadElementF64, LoadElementBasedF64,
                 LoadPlaneF64, LoadPlaneBasedF64, StoreF64, StoreBasedF64, StoreElementF64, StoreElementBasedF64, StorePlaneF64, StorePlaneBasedF64, StoreConstF64, StoreBasedConstF64)
            ]
            [
                (F32, f32, canonical_f32, LoadForeignF32, LoadForeignBasedF32, LoadForeignElementF32, LoadForeignElementBasedF32,
                 LoadForeignPlaneF32, LoadForeignPlaneBasedF32),
                (F64, f64, canonical_f64, LoadForeignF64, LoadForeignBasedF64, LoadForeignElementF64, LoadForeignElementBasedF64,
                 LoadForeignPlaneF64, LoadForeignPlaneBasedF64)
            ]
            [
                (I32Eq, i32_eq, [I32 I32], IfI32Eq, UnlessI32Eq, IfI32EqConst, UnlessI32EqConst),
                (I32Ne, i32_ne, [I32 I32], IfI32Ne, UnlessI32Ne, IfI32NeConst, UnlessI32NeConst),
                (I32LtS, i32_lt_s, [I32 I32], IfI32LtS, UnlessI32LtS, IfI32LtSConst, UnlessI32LtSConst),
                (I32LtU, i32_lt_u, [I32 I32], IfI32LtU, UnlessI32LtU, IfI32LtUConst, UnlessI32LtUConst),
                (I32LeS, i32_le_s, [I32 I32], IfI32LeS, UnlessI32LeS, IfI32LeSConst, UnlessI32LeSConst),
                (I32LeU, i32_le_u, [I32 I32], IfI32LeU, UnlessI32LeU, IfI32LeUConst, UnlessI32LeUConst),
                (I32GtS, i32_gt_s, [I32 I32], IfI32GtS, UnlessI32GtS, IfI32GtSConst, UnlessI32GtSConst),
                (I32GtU, i32_gt_u, [I32 I32], IfI32GtU, UnlessI32GtU, IfI32GtUConst, UnlessI32GtUConst),
                (I32GeS, i32_ge_s, [I32 I32], IfI32GeS, UnlessI32GeS, IfI32GeSConst, UnlessI32GeSConst),
                (I32GeU, i32_ge_u, [I32 I32], IfI32GeU, UnlessI32GeU, IfI32GeUConst, UnlessI32GeUConst),
                (I64Eq, i64_eq, [I64 I64], IfI64Eq, UnlessI64Eq, IfI64EqConst, UnlessI64EqConst),
                (I64Ne, i64_ne, [I64 I64], IfI64Ne, UnlessI64Ne, IfI64NeConst, UnlessI64NeConst),
                (I64LtS, i64_lt_s, [I64 I64], IfI64LtS, UnlessI64LtS, IfI64LtSConst, UnlessI64LtSConst),
                (I64LtU, i64_lt_u, [I64 I64], IfI64LtU, UnlessI64LtU, IfI64LtUConst, UnlessI64LtUConst),
                (I64LeS, i64_le_s, [I64 I64], IfI64LeS, UnlessI64LeS, IfI64LeSConst, UnlessI64LeSConst),
                (I64LeU, i64_le_u, [I64 I64], IfI64LeU, UnlessI64LeU, IfI64LeUConst, UnlessI64LeUConst),
                (I64GtS, i64_gt_s, [I64 I64], IfI64GtS, UnlessI64GtS, IfI64GtSConst, UnlessI64GtSConst),
                (I64GtU, i64_gt_u, [I64 I64], IfI64GtU, UnlessI64GtU, IfI64GtUConst, UnlessI64GtUConst),
                (I64GeS, i64_ge_s, [I64 I64], IfI64GeS, UnlessI64GeS, IfI64GeSConst, UnlessI64GeSConst),
                (I64GeU, i64_ge_u, [I64 I64], IfI64GeU, UnlessI64GeU, IfI64GeUConst, UnlessI64GeUConst),
                (F32Eq, f32_eq, [F32 F32], IfF32Eq, UnlessF32Eq, IfF32EqConst, UnlessF32EqConst),
                (F32Ne, f32_ne, [F32 F32], IfF32Ne, UnlessF32Ne, IfF32NeConst, UnlessF32NeConst),
                (F32Lt, f32_lt, [F32 F32], IfF32Lt, UnlessF32Lt, IfF32LtConst, UnlessF32LtConst),
                (F32Le, f32_le, [F32 F32], IfF32Le, UnlessF32Le, IfF32LeConst, UnlessF32LeConst),
                (F32Gt, f32_gt, [F32 F32], IfF32Gt, UnlessF32Gt, IfF32GtConst, UnlessF32GtConst),
                (F32Ge, f32_ge, [F32 F32], IfF32Ge, UnlessF32Ge, IfF32GeConst, UnlessF32GeConst),
                (F64Eq, f64_eq, [F64 F64], IfF64Eq, UnlessF64Eq, IfF64EqConst, UnlessF64EqConst),
                (F64Ne, f64_ne, [F64 F64], IfF64Ne, UnlessF64Ne, IfF64NeConst, UnlessF64NeConst),
                (F64Lt, f64_lt, [F64 F64], IfF64Lt, UnlessF64Lt, IfF64LtConst, UnlessF64LtConst),
                (F64Le, f64_le, [F64 F64], IfF64Le, UnlessF64Le, IfF64LeConst, UnlessF64LeConst),
                (F64Gt, f64_gt, [F64 F64], IfF64Gt, UnlessF64Gt, IfF64GtConst, UnlessF64GtConst),
                (F64Ge, f64_ge, [F64 F64], IfF64Ge, UnlessF64Ge, IfF64GeConst, UnlessF64GeConst)
            ]
            [
                (I32Add, i32_add, i32, LoadElementBasedI32, LoadPlaneBasedI32, I32AddElement, I32AddPlane, true),
                (I32Sub, i32_sub, i32, LoadElementBasedI32, LoadPlaneBasedI32, I32SubElement, I32SubPlane, false),
                (I32Mul, i32_mul, i32, LoadElementBasedI32, LoadPlaneBasedI32, I32MulElement, I32MulPlane, true),
                (I32Xor, i32_xor, i32, LoadElementBasedI32, LoadPlaneBasedI32, I32XorElement, I32XorPlane, true),
                (F32Add, f32_add, f32, LoadElementBasedF32, LoadPlaneBasedF32, F32AddElement, F32AddPlane, true),
                (F32Sub, f32_sub, f32, LoadElementBasedF32, LoadPlaneBasedF32, F32SubElement, F32SubPlane, false),
                (F32Mul, f32_mul, f32, LoadElementBasedF32, LoadPlaneBasedF32, F32MulElement, F32MulPlane, true),
                (F64Add, f64_add, f64, LoadElementBasedF64, LoadPlaneBasedF64, F64AddElement, F64AddPlane, true),
                (F64Sub, f64_sub, f64, LoadElementBasedF64, LoadPlaneBasedF64, F64SubElement, F64SubPlane, false),
                (F64Mul, f64_mul, f64, LoadElementBasedF64, LoadPlaneBasedF64, F64MulElement, F64MulPlane, true)
            ]
            [
                (F32Add, f32_add, f32_mul, f32, F32MulElement, F32MulPlane, F32SumElement, F32SumPlane),
                (F64Add, f64_add, f64_mul, f64, F64MulElement, F64MulPlane, F64SumElement, F64SumPlane)
            ]
        }
    };
}
pub(crate) use for_each_operation;
