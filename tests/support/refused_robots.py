"""The robots of example-robot-data that cannot be loaded, and their messages."""

NO_MASS = (
    "no mass moves with bravo_finger1_joint, bravo_finger2_joint, so that the mass"
)
NO_HAND_MASS = "no mass moves with LHand, RHand, so that the mass"
NO_LEADER = (
    "'Left_index_q2' mimics 'index_q1', which is not a moving joint; .*mimic=False"
)
REFUSED = {
    "bravo7_gripper": NO_MASS,
    "falcon_bravo7_gripper": NO_MASS,
    "bluevolta_bravo7_gripper": NO_MASS,
    "alex_psyonic_hands": NO_LEADER,
    "romeo": NO_HAND_MASS,
}
