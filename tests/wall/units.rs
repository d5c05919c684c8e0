//! Public numbers have their unit in the name, or a type whose name is the quantity.
//!
//! Read are fields and constants of `core`, `machine` and `daemon`, and parameters of public functions of `core`. `[f64; 6]` is X,
//! `[f64; LEGS]` a number per leg. Not read are results, which are named after the function's quantity, and the JSON of the operator.

use quote::ToTokens;
use syn::visit::{self, Visit};
use syn::{Attribute, FnArg, Ident, ImplItem, ItemConst, ItemEnum, ItemFn, ItemImpl, ItemMod, ItemStruct};
use syn::{Pat, Signature, Type, Visibility};

use super::{files, source};

/// What a name ends with, after an underscore.
const UNITS: &str = "m m2 m3 rad s ns n kg hz m_s m_s2 rad_s rad_s2 s2 s3 m2_s4 kg_m2 n_s_m n_s";
/// Words for a number without a unit.
const WITHOUT_UNIT: &str = "ratio ratios share shares scale condition sine norm gain correlation factor count determinant periods cost precision quantile";
/// What a vector is, by its own name or its owner's.
const VECTORS: &str = "acceleration velocity displacement direction axis wrench twist pose offset";

/// What needs no unit: a file, a type or a function, and why.
const EXCEPTIONS: &[(&str, &str)] = &[
    ("fused", "arithmetic"),
    ("lanes", "arithmetic"),
    ("lanes3", "vectors of any unit"),
    ("lu", "linear algebra"),
    ("padding", "vectors of any unit"),
    ("triples", "numbers of any unit, by leg"),
    ("factorization", "matrices of the paper"),
    ("pose_factorization", "matrices of the paper"),
    ("minimum_jerk", "X; of an angle or a position"),
    ("ForceBound", "norm of a wrench, torques in newtons times the radius"),
    ("ForceChangeBounds", "change of a direction"),
    ("CenterDistance", "changes of directions"),
    ("CONVERGED_STEP", "radian, or radius"),
    ("Sensitivity", "radian, or radius"),
    ("OtherMode", "radian, or radius"),
    ("MAX_KANTOROVICH_H", "h of Kantorovich's theorem"),
    ("LegDynamics", "joint coordinates: angle, angle, length"),
    ("TaskState", "X, X', X''"),
    ("Timeline", "X"),
    ("quaternion_of", "a quaternion"),
    ("ErrorCoordinates", "of X, or of leg lengths"),
    ("ErrorEstimate", "of X, or of leg lengths"),
    ("Covariance", "in units of the noise of a length"),
    ("DerivativeLimits", "of an angle or a position"),
    ("vector_stop", "of an angle or a position"),
    ("acceleration_ranges", "of an angle or a position"),
    ("Approach", "of an angle or a position"),
    ("DerivativeBound", "of an angle or a position"),
    ("RANGE_ROUNDING", "of an angle or a position"),
    ("cubic_departure", "speeds v and w of the derivation"),
    ("Diagnostic", "in the unit of the code"),
    ("DerivedLimit", "in the unit of the key"),
    ("WorkspaceBound", "in the unit of the bound"),
    ("numbers", "numbers of any unit"),
    ("identification", "in the unit of the parameter; the keys of the JSON"),
    ("SampledLoop", "times the period, which is the unit of time"),
    ("RegionBounds", "a size, in the unit of the shape"),
    ("Difference", "in the unit of the field"),
];

#[derive(Default)]
struct Numbers {
    owner: String,
    /// Owner and name of each number, and whether it is a vector.
    found: Vec<(String, String, bool)>,
    with_parameters: bool,
}

/// Of a number or an array of numbers, whether it is a vector.
fn number(of: &Type) -> Option<bool> {
    let text = of.to_token_stream().to_string().replace(' ', "");
    let inner = text.trim_start_matches(['&', '[']).replace("Option<", "").replace("mut", "");
    let is_x = ["[f64;6]", "[Option<f64>;6]"].iter().any(|x| text.contains(x)) && !text.contains("[[");
    let is_vector = inner.starts_with("Vector3<f64>") || inner.starts_with("Vector6<f64>");
    (!is_x && (is_vector || inner.trim_start_matches('[').starts_with("f64"))).then_some(is_vector)
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| attribute.to_token_stream().to_string().contains("cfg (test)"))
}

impl Numbers {
    fn add(&mut self, owner: &str, visibility: &Visibility, name: &Ident, of: &Type) {
        if let Some(is_vector) = number(of).filter(|_| !matches!(visibility, Visibility::Inherited)) {
            self.found.push((owner.into(), name.to_string(), is_vector));
        }
    }

    fn add_parameters(&mut self, visibility: &Visibility, signature: &Signature) {
        let owner = if self.owner.is_empty() { signature.ident.to_string() } else { self.owner.clone() };
        let count = if self.with_parameters { signature.inputs.len() } else { 0 };
        for input in signature.inputs.iter().take(count) {
            if let FnArg::Typed(typed) = input
                && let Pat::Ident(name) = &*typed.pat
            {
                self.add(&owner, visibility, &name.ident, &typed.ty);
            }
        }
    }
}

impl<'ast> Visit<'ast> for Numbers {
    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_struct(&mut self, item: &'ast ItemStruct) {
        for field in &item.fields {
            if let Some(name) = &field.ident {
                self.add(&item.ident.to_string(), &field.vis, name, &field.ty);
            }
        }
    }

    fn visit_item_enum(&mut self, item: &'ast ItemEnum) {
        for field in item.variants.iter().flat_map(|variant| &variant.fields) {
            if let Some(name) = &field.ident {
                self.add(&item.ident.to_string(), &item.vis, name, &field.ty);
            }
        }
    }

    fn visit_item_const(&mut self, item: &'ast ItemConst) {
        self.add(&item.ident.to_string(), &item.vis, &item.ident, &item.ty);
    }

    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        self.add_parameters(&item.vis, &item.sig);
    }

    fn visit_item_impl(&mut self, item: &'ast ItemImpl) {
        self.owner = item.self_ty.to_token_stream().to_string().replace(' ', "");
        for entry in &item.items {
            match entry {
                ImplItem::Const(constant) => {
                    self.add(&constant.ident.to_string(), &constant.vis, &constant.ident, &constant.ty);
                }
                ImplItem::Fn(function) => self.add_parameters(&function.vis, &function.sig),
                _ => {}
            }
        }
        self.owner.clear();
    }
}

/// Whether a name shows what its number is.
fn has_unit((owner, name, is_vector): &(String, String, bool)) -> bool {
    let (owner, name) = (owner.to_lowercase(), name.to_lowercase());
    UNITS.split(' ').any(|unit| name.ends_with(&format!("_{unit}")))
        || name.contains("_per_")
        || WITHOUT_UNIT.split(' ').any(|word| name.split('_').any(|part| part == word))
        || *is_vector && VECTORS.split(' ').any(|noun| name.contains(noun) || owner.contains(noun))
}

#[test]
fn public_numbers_have_their_unit() {
    let (mut seen, mut wrong, mut used) = (0, vec![], vec![]);
    for folder in ["core", "machine", "daemon"] {
        for file in files(&source().join(folder)) {
            if file.components().any(|part| part.as_os_str().to_str().unwrap().starts_with("tests")) {
                continue;
            }
            let text = std::fs::read_to_string(&file).unwrap();
            let mut numbers = Numbers { with_parameters: folder == "core", ..Numbers::default() };
            numbers.visit_file(&syn::parse_file(&text).unwrap());
            seen += numbers.found.len();
            for number in numbers.found.into_iter().filter(|number| !has_unit(number)) {
                let owner = number.0.split(['<', ':']).next().unwrap().to_string();
                let names = [&number.0, &owner, &number.1];
                let is_in =
                    |name: &str| file.file_stem().unwrap() == name || file.parent().unwrap().ends_with(name);
                let excepted = |(name, _): &&(&str, &str)| is_in(name) || names.iter().any(|it| it == name);
                match EXCEPTIONS.iter().find(excepted) {
                    Some((name, _)) => used.push(*name),
                    None => wrong.push(format!("{}: {}.{}", file.display(), number.0, number.1)),
                }
            }
        }
    }
    let unused: Vec<_> = EXCEPTIONS.iter().filter(|(name, _)| !used.contains(name)).collect();
    assert!(seen > 500 && wrong.is_empty() && unused.is_empty(), "{seen} {unused:?}\n{}", wrong.join("\n"));
}
