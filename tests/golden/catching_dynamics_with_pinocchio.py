"""Joint torques and poses of the catching robot from Pinocchio, checked against MuJoCo; the Rust test
`torques_and_places_are_those_of_pinocchio` relies on them.

    python -m venv venv && venv/bin/pip install pin==4.1.0 mujoco==4.0.0
    venv/bin/python tests/golden/catching_dynamics_with_pinocchio.py

Builds the tree from catching/packets/src/robot.toml. The passive joint under the chest counts as a joint of its own (number 4 of
21), so that it is covered too. Writes tests/golden/catching_dynamics_with_pinocchio.json, floats in full.
"""

import json
import tomllib
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

ROOT = Path(__file__).resolve().parents[2]
GRAVITY = 9.81
AXES = {"y": [0.0, 1.0, 0.0], "-y": [0.0, -1.0, 0.0], "z": [0.0, 0.0, 1.0]}


def bodies(robot):
    """Returns (parent, kind, axis, translation, lean about x, link) of each body, parents first; -1 is the ground."""
    torso, neck = robot["torso"], robot["neck"]
    up = lambda height: np.array([0.0, 0.0, height])
    tree = [
        (-1, "slide", "y", up(0.0), 0.0, robot["platform"]["link"]),
        (0, "hinge", "z", up(torso["lower_pitch_height"]), 0.0, torso["links"][0]),
        (1, "hinge", "y", up(0.0), 0.0, torso["links"][1]),
        (2, "hinge", "y", up(torso["lower_length"]), 0.0, torso["links"][2]),
        (3, "hinge", "y", up(torso["upper_length"]), 0.0, torso["links"][3]),
        (4, "hinge", "z", up(neck["height"]), 0.0, neck["links"][0]),
        (5, "hinge", "y", up(0.0), 0.0, neck["links"][1]),
    ]
    for arm in robot["arms"]:
        lean = arm["lean"]
        along = np.array([0.0, -np.sin(lean), np.cos(lean)])
        shoulder = np.array(arm["position"]) + along * arm["base_to_shoulder"]
        offsets = {3: arm["shoulder_to_elbow"], 5: arm["elbow_to_wrist"]}
        for joint, axis in enumerate(["z", "-y", "z", "y", "z", "-y", "z"]):
            link = arm["links"][joint]
            if joint == 0:
                tree.append((4, "hinge", axis, shoulder, lean, link))
            else:
                tree.append((len(tree) - 1, "hinge", axis, up(offsets.get(joint, 0.0)), 0.0, link))
    return tree


def with_pinocchio(tree):
    model = pin.Model()
    model.gravity = pin.Motion(np.array([0.0, 0.0, -GRAVITY]), np.zeros(3))
    ids = []
    for number, (parent, kind, axis, translation, lean, link) in enumerate(tree):
        unaligned = pin.JointModelPrismaticUnaligned if kind == "slide" else pin.JointModelRevoluteUnaligned
        placement = pin.SE3(pin.utils.rotate("x", lean), translation)
        joint = model.addJoint(0 if parent < 0 else ids[parent], unaligned(np.array(AXES[axis])), placement, f"j{number}")
        inertia = pin.Inertia(link["mass"], np.array(link["centre"]), np.diag(link["inertia"]))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        ids.append(joint)
    return model, ids


def with_mujoco(tree):
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    made = []
    for number, (parent, kind, axis, translation, lean, link) in enumerate(tree):
        carrier = spec.worldbody if parent < 0 else made[parent]
        body = carrier.add_body(
            name=f"b{number}",
            pos=translation,
            quat=[np.cos(lean / 2), np.sin(lean / 2), 0.0, 0.0],
            mass=link["mass"],
            ipos=link["centre"],
            inertia=link["inertia"],
            explicitinertial=True,
        )
        joint_type = mujoco.mjtJoint.mjJNT_SLIDE if kind == "slide" else mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(type=joint_type, axis=AXES[axis])
        made.append(body)
    return spec.compile()


def main():
    robot = tomllib.loads((ROOT / "catching/packets/src/robot.toml").read_text())
    tree = bodies(robot)
    model, ids = with_pinocchio(tree)
    data = model.createData()
    peer = with_mujoco(tree)
    peer_data = mujoco.MjData(peer)
    to_catch = [pin.SE3(np.eye(3), np.array([0.0, 0.0, arm["wrist_to_catch"]])) for arm in robot["arms"]]
    rng = np.random.default_rng(20)
    cases = []
    worst = 0.0
    for _ in range(8):
        q, dq, ddq = (rng.uniform(-size, size, len(tree)) for size in (1.5, 3.0, 20.0))
        tau = pin.rnea(model, data, q, dq, ddq)
        peer_data.qpos[:], peer_data.qvel[:], peer_data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(peer, peer_data)
        worst = max(worst, float(np.abs(peer_data.qfrc_inverse - tau).max()))
        pin.forwardKinematics(model, data, q)
        poses = {
            "head": data.oMi[ids[6]],
            "left": data.oMi[ids[13]] * to_catch[0],
            "right": data.oMi[ids[20]] * to_catch[1],
        }
        case = {"q": q.tolist(), "dq": dq.tolist(), "ddq": ddq.tolist(), "tau": tau.tolist()}
        for name, pose in poses.items():
            case[name] = {"position": pose.translation.tolist(), "rotation": pose.rotation.ravel().tolist()}
        cases.append(case)
    assert worst < 1e-9, worst
    golden = {
        "versions": {"pin": pin.__version__, "mujoco": mujoco.__version__, "numpy": np.__version__},
        "mujoco_differs_by_nm": worst,
        "cases": cases,
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
