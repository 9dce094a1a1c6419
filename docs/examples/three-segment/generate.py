#!/usr/bin/env python3
"""Makes the example: robot.urdf (what its builders believe), truth.json, and two records measured in MuJoCo.

    python3 -m venv venv && venv/bin/pip install mujoco==4.0.0 numpy
    venv/bin/python generate.py [FOLDER]

Nothing of ffid is used here. The spacecraft floats freely (no gravity, no contacts): a bus with a six-joint arm, a wing of
three segments whose hinges are askew to all axes of the bus, and fuel as a spherical pendulum (two hinges that cross).
MuJoCo integrates with RK4 at 0.5 ms; the torques of the arm follow a planned motion by feedback and are what the sensors
behind the gears read. Damping and stiffness of wing and fuel are those of MuJoCo's joints.
"""
import json
import pathlib
import sys

import mujoco
import numpy as np

RATE, SECONDS, STEP = 50.0, 40.0, 5e-4
NOISE = {"torque_nm": 0.05, "gyro_rad_per_s": 1e-4, "encoder_bits": 20}
JOINTS = [f"arm_{k}" for k in range(1, 7)]
GAINS = np.array([2000.0, 2000.0, 1200.0, 150.0, 60.0, 40.0])
START = np.array([0.4, -0.7, 1.1, 0.3, -0.6, 0.2])

# The bus as it is, about its centre of mass in axes of its frame; and as the drawings have it (with fuel since burnt).
BUS = dict(mass=412.0, com=[0.12, -0.08, 0.21], inertia=[118.0, 7.5, -9.0, 141.0, 5.5, 96.0])  # xx xy xz yy yz zz
BUS_DRAWN = dict(mass=445.0, com=[0.10, -0.05, 0.17], inertia=[128.0, 5.0, -6.0, 150.0, 4.0, 104.0])
# Links: mass, centre of mass, inertia about it, pose of the joint in the parent (xyz, rpy), axis.
ARM = [
    (9.5, [0.02, 0.01, 0.11], [0.09, 0.004, -0.006, 0.10, 0.003, 0.05], [0.55, 0.25, 0.62], [0.1, -0.2, 0.3], [0, 0, 1]),
    (14.0, [0.38, 0.02, 0.03], [0.06, 0.008, 0.01, 0.95, 0.004, 0.96], [0.0, 0.08, 0.22], [0, 0, 0], [0, 1, 0]),
    (11.0, [0.33, -0.03, 0.01], [0.05, -0.006, 0.008, 0.72, 0.003, 0.73], [0.8, 0.0, 0.05], [0, 0, 0], [0, 1, 0]),
    (4.2, [0.05, 0.01, -0.04], [0.02, 0.001, -0.002, 0.03, 0.001, 0.025], [0.7, -0.04, 0.0], [0.2, 0, 0], [1, 0, 0]),
    (3.8, [0.02, 0.05, 0.03], [0.018, 0.001, 0.001, 0.02, -0.001, 0.019], [0.12, 0.0, 0.0], [0, 0, 0], [0, 0.6, 0.8]),
    (6.5, [0.04, -0.02, 0.13], [0.07, 0.003, -0.004, 0.06, 0.002, 0.04], [0.1, 0.05, 0.08], [0, 0.3, 0], [0, 0, 1]),
]
AXIS = [0.936, 0.0, 0.352]  # of all hinges of the wing, in their frames; askew to the bus by the pose of the first
AXIS = [x / np.linalg.norm(AXIS) for x in AXIS]
WING = [
    (12.5, [0.05, 0.82, 0.02], [2.9, 0.05, 0.02, 0.6, -0.04, 3.4], [-0.35, 0.62, 0.30], [0.15, 0.1, -0.2], AXIS),
    (11.0, [-0.03, 0.78, 0.01], [2.5, -0.03, 0.01, 0.55, 0.03, 3.0], [0.0, 1.65, 0.0], [0, 0, 0], AXIS),
    (10.0, [0.04, 0.75, -0.02], [2.3, 0.04, -0.02, 0.55, 0.02, 2.75], [0.0, 1.60, 0.0], [0, 0, 0], AXIS),
]
WING_K, WING_D = [310.0, 190.0, 120.0], [2.6, 1.7, 1.1]
TANK = dict(at=[-0.25, 0.18, 0.35], mass=64.0, length=0.52, k=[11.0, 14.5], d=[2.1, 1.6])


def words(xs):
    return " ".join(repr(float(x)) for x in xs)


def urdf():
    def link(name, mass, com, i):
        return (
            f'  <link name="{name}">\n    <inertial>\n      <origin xyz="{words(com)}" rpy="0 0 0"/>\n'
            f'      <mass value="{mass}"/>\n      <inertia ixx="{i[0]}" ixy="{i[1]}" ixz="{i[2]}" iyy="{i[3]}" '
            f'iyz="{i[4]}" izz="{i[5]}"/>\n    </inertial>\n  </link>\n'
        )

    def joint(name, parent, child, xyz, rpy, axis, effort):
        return (
            f'  <joint name="{name}" type="revolute">\n    <parent link="{parent}"/>\n    <child link="{child}"/>\n'
            f'    <origin xyz="{words(xyz)}" rpy="{words(rpy)}"/>\n    <axis xyz="{words(axis)}"/>\n'
            f'    <limit lower="-2.9" upper="2.9" effort="{effort}" velocity="0.6"/>\n  </joint>\n'
        )

    out = '<?xml version="1.0"?>\n<!-- Written by generate.py: the spacecraft as its drawings have it. -->\n<robot name="surveyor">\n'
    out += link("bus", BUS_DRAWN["mass"], BUS_DRAWN["com"], BUS_DRAWN["inertia"])
    for prefix, chain, effort in (("arm", ARM, 150), ("wing", WING, 0)):
        parent = "bus"
        for k, (m, c, i, xyz, rpy, axis) in enumerate(chain, 1):
            name = f"{prefix}_{k}_link"
            out += joint(f"{prefix}_{k}", parent, name, xyz, rpy, axis, effort) + link(name, m, c, i)
            parent = name
    out += '  <joint name="grip" type="fixed">\n    <parent link="arm_6_link"/>\n    <child link="gripper"/>\n'
    out += '    <origin xyz="0.0 0.0 0.28" rpy="0 0 0"/>\n  </joint>\n  <link name="gripper"/>\n</robot>\n'
    return out


def mjcf():
    def rotation(rpy):
        # Roll, pitch, yaw as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll).
        r, p, y = rpy
        q = [np.zeros(4) for _ in range(3)]
        for k, (axis, angle) in enumerate((([1, 0, 0], r), ([0, 1, 0], p), ([0, 0, 1], y))):
            mujoco.mju_axisAngle2Quat(q[k], np.array(axis, float), angle)
        zy, out = np.zeros(4), np.zeros(4)
        mujoco.mju_mulQuat(zy, q[2], q[1])
        mujoco.mju_mulQuat(out, zy, q[0])
        return words(out)

    def inertial(mass, com, i):
        return f'<inertial pos="{words(com)}" mass="{mass}" fullinertia="{words([i[0], i[3], i[5], i[1], i[2], i[4]])}"/>'

    def chain(prefix, rows, springs):
        out = ""
        for k, (m, c, i, xyz, rpy, axis) in enumerate(rows, 1):
            spring = f'stiffness="{springs[0][k-1]}" damping="{springs[1][k-1]}"' if springs else ""
            out += f'<body name="{prefix}_{k}_link" pos="{words(xyz)}" quat="{rotation(rpy)}">'
            out += f'<joint name="{prefix}_{k}" type="hinge" axis="{words(axis)}" {spring}/>' + inertial(m, c, i)
        return out + "</body>" * len(rows)

    t = TANK
    fuel = f'<body name="fuel" pos="{words(t["at"])}">'
    for k, axis in enumerate(("1 0 0", "0 1 0")):
        fuel += f'<joint name="swing_{k}" type="hinge" axis="{axis}" stiffness="{t["k"][k]}" damping="{t["d"][k]}"/>'
    # A point mass: MuJoCo wants some inertia, here a millionth of that about the fulcrum.
    fuel += f'<inertial pos="0 0 {-t["length"]}" mass="{t["mass"]}" diaginertia="2e-5 2e-5 2e-5"/></body>'
    motors = "".join(f'<motor name="{j}" joint="{j}" gear="1"/>' for j in JOINTS)
    return f"""<mujoco model="surveyor">
  <compiler angle="radian" autolimits="false" inertiafromgeom="false"/>
  <option timestep="{STEP}" integrator="RK4" gravity="0 0 0"><flag contact="disable"/></option>
  <worldbody>
    <body name="bus"><freejoint/>{inertial(BUS["mass"], BUS["com"], BUS["inertia"])}<site name="gyro"/>
      {chain("arm", ARM, None)}
      {chain("wing", WING, (WING_K, WING_D))}
      {fuel}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
  <sensor><gyro name="gyro" site="gyro"/></sensor>
</mujoco>
"""


def motion(phase):
    """Joint positions, rates, accelerations: sums of sines in a window that rests at both ends."""
    rng = np.random.default_rng(phase)
    f = np.array([[0.05, 0.11, 0.19, 0.31]]) * rng.uniform(0.8, 1.25, (6, 4))
    a = np.array([0.34, 0.15, 0.07, 0.03]) * rng.uniform(0.6, 1.1, (6, 4))
    p = rng.uniform(0, 2 * np.pi, (6, 4))

    def at(t):
        s = np.clip(t / SECONDS, 0.0, 1.0)
        w, w1, w2 = [np.polyval(c, s) for c in WINDOW]
        x = 2 * np.pi * f * t + p
        y = (a * np.sin(x)).sum(1)
        y1 = (a * np.cos(x) * 2 * np.pi * f).sum(1)
        y2 = -(a * np.sin(x) * (2 * np.pi * f) ** 2).sum(1)
        T = SECONDS
        return START + w * y, w1 / T * y + w * y1, w2 / T**2 * y + 2 * w1 / T * y1 + w * y2

    return at


_W = np.poly1d([-4.0, 4.0, 0.0]) ** 3
WINDOW = [_W.coeffs, _W.deriv(1).coeffs, _W.deriv(2).coeffs]


def measure(model, phase, path):
    data = mujoco.MjData(model)
    q_at = [model.joint(j).qposadr[0] for j in JOINTS]
    v_at = [model.joint(j).dofadr[0] for j in JOINTS]
    data.qpos[q_at] = START
    at = motion(phase)

    def control(_, d):
        q, v, acc = at(d.time)
        d.ctrl[:] = GAINS * (0.01 * acc + 1.0 * (q - d.qpos[q_at]) + 0.15 * (v - d.qvel[v_at]))

    mujoco.set_mjcb_control(control)
    every, rows = round(1 / RATE / STEP), []
    for k in range(round(SECONDS * RATE) + 1):
        mujoco.mj_forward(model, data)
        rows.append(np.concatenate([[k / RATE], data.qpos[q_at], data.actuator_force, data.sensordata]))
        for _ in range(every):
            mujoco.mj_step(model, data)
    mujoco.set_mjcb_control(None)
    rows = np.array(rows)
    # What never leaves the bus: momentum is conserved, which is a check of the simulation.
    mujoco.mj_subtreeVel(model, data)
    drift = np.abs(data.subtree_linvel[1] * model.body_subtreemass[1]).max(), np.abs(data.subtree_angmom[1]).max()
    rng = np.random.default_rng(1000 + phase)
    step = 2 * np.pi / 2 ** NOISE["encoder_bits"]
    rows[:, 1:7] = np.degrees(np.round(rows[:, 1:7] / step) * step)
    rows[:, 7:13] += rng.normal(0, NOISE["torque_nm"], (len(rows), 6))
    rows[:, 13:16] += rng.normal(0, NOISE["gyro_rad_per_s"], (len(rows), 3))
    names = [f"q.{j}[deg]" for j in JOINTS] + [f"tau.{j}[N m]" for j in JOINTS] + [f"gyro.{a}[mrad/s]" for a in "xyz"]
    rows[:, 13:16] *= 1e3
    with open(path, "w", newline="\n") as f:
        f.write(",".join(["time[s]"] + names) + "\n")
        for r in rows:
            cells = [f"{r[0]:.2f}"] + [f"{x:.5f}" for x in r[1:7]] + [f"{x:.4f}" for x in r[7:16]]
            f.write(",".join(cells) + "\n")
    return drift


def truth():
    def ten(b):
        m, c = b["mass"], np.array(b["com"])
        xx, xy, xz, yy, yz, zz = b["inertia"]
        i = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + m * (c @ c * np.eye(3) - np.outer(c, c))
        names = ["mass", "h_x", "h_y", "h_z", "i_xx", "i_xy", "i_yy", "i_xz", "i_yz", "i_zz"]
        values = [m, *(m * c), i[0, 0], i[0, 1], i[1, 1], i[0, 2], i[1, 2], i[2, 2]]
        return {f"base.{n}": float(v) for n, v in zip(names, values)}

    out = ten(BUS)
    for k in range(3):
        out[f"wing.k[{k}]"], out[f"wing.d[{k}]"] = WING_K[k], WING_D[k]
    out["tank.mass"], out["tank.length"] = TANK["mass"], TANK["length"]
    for k in range(2):
        out[f"tank.k[{k}]"], out[f"tank.d[{k}]"] = TANK["k"][k], TANK["d"][k]
    return out


def main():
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent)
    (folder / "robot.urdf").write_text(urdf())
    (folder / "robot.xml").write_text(mjcf())
    model = mujoco.MjModel.from_xml_string(mjcf())
    for phase, name in ((1, "record.csv"), (2, "other.csv")):
        print(name, measure(model, phase, folder / name))
    made = {"made_by": f"MuJoCo {mujoco.__version__}, generate.py", "noise": NOISE, "values": truth()}
    (folder / "truth.json").write_text(json.dumps(made, indent=2) + "\n")


main()
