//! Same numbers: no bit of a simulation changes unnoticed.
//!
//! Where this fails and the change is meant, the changelog says so under "Reproducibility-breaking",
//! and the new hashes, which the failure shows, take the places of the old ones.

mod common;

use common::{Reference, bits, references, sensitive};
use morphcog_sim::Physics;
use sha2::{Digest, Sha256};

/// SHA-256 over the bits of x and y of all points before the first control step and after each, in
/// little endian.
const SIMULATIONS: [(&str, &str); 21] = [
    (
        "bar_12x12_09",
        "4f30bdc53ddfc5b08c29d4233784a1a20bcd314b72d26e0fdb95229e24f26fd2",
    ),
    (
        "bar_14x14_05",
        "39b53683f9d1fcb20c2cf8aca6643d087f54472fe659ce471ba32e8f22e67d9f",
    ),
    (
        "bar_6x9_01",
        "8affb5d81a11eadfb8b35e28d41d7a11fc745a9846574b00d6c6fe1765415197",
    ),
    (
        "bar_6x9_13",
        "a17ef37af3d644b8fa9d58e39274633cb7ea5b4e7ef40d9a729de9a1ebd6320b",
    ),
    (
        "disc_14x14_04",
        "bd0047549ac0193ae3c2c38aed4ea5f50b4072e5ce28c323628e7f2ca2b8b6cf",
    ),
    (
        "disc_14x14_08",
        "a250081ee007d7f0067bb9be473dea8ebd2e69f20915b1849df878b422c8083f",
    ),
    (
        "disc_5x5_00",
        "6e8f0adf35ec04c0e2a91820ff5f831a59dd67f62e510796f1e60da607809020",
    ),
    (
        "disc_5x5_12",
        "ed18d282bab082f091be15b0e0aa841cdf34c01ff26ff5b7d3d7890d7fd52bc7",
    ),
    (
        "grad_10x14_06",
        "789a44a5d46d8f4180fbbe19832bf57dc82fcaec4d35b560bfddb9455b0a0d9e",
    ),
    (
        "grad_14x14_10",
        "e8475ffafba391b708cc2f3417470141a3bd83b8822d25c6d7d90d4813f1e38b",
    ),
    (
        "grad_8x8_02",
        "b94a6c34d8e1b2edd2275d18c07be3d9b18df78ceeba481cf4fd6255dddee75a",
    ),
    (
        "grad_8x8_14",
        "29501037e92f385347ae0678670694493f09476517e531111ad02bd3259331ee",
    ),
    (
        "rand_14x14_03",
        "ca7d7a247c77e5f5d36561825001773efda690dd97a15815bd193e2603393911",
    ),
    (
        "rand_14x14_11",
        "73affda7d7cb8941f1acee0242a76715b1befb5046f3e0bc0a26b00c574f8b0a",
    ),
    (
        "rand_14x14_15",
        "43f168476770a11ffe1b66e5d652e37a4aced09bfd9cfb88d5d45d50780255aa",
    ),
    (
        "rand_14x7_07",
        "67861562abd747fafaa24787e56ea51c72f041b1d1ad3c1569a90693c08784c9",
    ),
    (
        "unstable_comb",
        "b6a43b3e260195c5b5fc41c8434b6bceef869a586e65a3bc9bb30351dea8ca5d",
    ),
    (
        "sensitive_0f692fb2ef",
        "156e5da248197c42769b03b38dc649e3f8aa1952ba739440962bdc9011044000",
    ),
    (
        "sensitive_432567bdf0",
        "6c5f071d58174fab1ad3b7da75042d12d754d9266008a47c16778521494b9913",
    ),
    (
        "sensitive_comb_12x14",
        "9e8f67661415046e739e557c06d4ed0197c44648a6897da654dda6eff43c206a",
    ),
    (
        "sensitive_f7ecf1b51e",
        "171e0303da5f0a00f48aeebeeb20e921e1a6f6b78394f353eabb9e8f05d1b712",
    ),
];

fn hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

#[test]
fn every_point_of_the_golden_simulations_has_the_same_bits_after_every_control_step() {
    let physics = Physics::default();
    let hash = |rollout: &Reference| {
        let steps = rollout.control_steps as usize + 1;
        let all: Vec<u8> = bits(rollout.world(&physics))
            .take(steps)
            .flatten()
            .collect();
        (rollout.name.clone(), hex(&all))
    };
    let rollouts: Vec<Reference> = references().into_iter().chain(sensitive()).collect();
    let found: Vec<_> = rollouts.iter().map(hash).collect();
    let pinned = SIMULATIONS.map(|(name, hash)| (name.to_string(), hash.to_string()));
    assert_eq!(
        found, pinned,
        "these numbers have moved; see the beginning of this file"
    );
}
