"""Random MJCF texts of planar mechanisms, mounted anyhow in space; MuJoCo itself says how a pose turns."""
import mujoco
import numpy as np

SHAPES = {'sphere': 1, 'capsule': 2, 'cylinder': 2, 'ellipsoid': 3, 'box': 3}


def digits(*values):
    return ' '.join(repr(float(value)) for value in np.hstack(values))


class RandomMjcf:
    """One text, by seed; `contacts`: of small geoms that may touch, else of such as never do."""

    def __init__(self, seed, contacts=False):
        self.contacts = contacts
        self.random = random = np.random.default_rng(seed)
        self.degrees = random.random() < 0.5
        self.eulerseq = ''.join(random.choice(list('xyzXYZ'), 3))
        self.normal = self.unit()
        self.joints = self.bodies = 0
        compiler = {'angle': ('degree' if self.degrees else 'radian') if self.degrees is False or random.random() < 0.5
                    else None, 'eulerseq': self.eulerseq}
        self.compiler_pose = ' '.join(f'{key}="{value}"' for key, value in compiler.items() if value)
        if random.random() < 0.2:
            compiler['boundmass'] = digits(random.uniform(0.0, 2.0))
        if random.random() < 0.2:
            compiler['boundinertia'] = digits(random.uniform(0.0, 0.1))
        if random.random() < 0.2:
            compiler['settotalmass'] = digits(random.uniform(1.0, 9.0))
        if random.random() < 0.2:
            compiler['balanceinertia'] = 'true'
        if random.random() < 0.2:
            compiler['inertiagrouprange'] = '0 3'
        self.from_geoms = random.choice(['auto', 'auto', 'true'])
        compiler['inertiafromgeom'] = self.from_geoms
        flags = ([] if contacts else ['contact="disable"']) + [
            f'{flag}="disable"' for flag in ('gravity', 'damper', 'spring', 'frictionloss', 'limit')
            if random.random() < 0.1]
        world = ''.join(self.body(np.eye(3), 0) for _ in range(1 if contacts else random.integers(1, 3)))
        while not self.joints:
            world = self.body(np.eye(3), 0)
        compiler = ' '.join(f'{key}="{value}"' for key, value in compiler.items() if value)
        gravity = f' gravity="{digits(random.normal(0, 9, 3))}"' if random.random() < 0.7 else ''
        self.text = (f'<mujoco model="m{seed}"><compiler {compiler}/><option timestep="0.01"{gravity}>'
                     f'<flag {" ".join(flags)}/></option>{self.defaults()}'
                     f'<worldbody>{self.walls()}{world}</worldbody></mujoco>')

    def walls(self):
        if not self.contacts:
            return '<geom type="plane" size="1 1 1"/>'
        return ''.join(f'<geom type="{kind}" size="0.3 0.2 0.1" pos="{digits(self.random.normal(0.0, 3.0, 3))}" '
                       f'zaxis="{digits(self.unit() if self.random.random() < 0.5 else self.normal)}"/>'
                       for kind in self.random.choice([*SHAPES, 'plane'], 2))

    def unit(self):
        vector = self.random.normal(0.0, 1.0, 3)
        return vector / np.linalg.norm(vector)

    def defaults(self):
        return ('<default><geom density="700"/><joint damping="0.1"/>'
                '<default class="heavy"><joint armature="0.2" stiffness="1.5"/><geom mass="1.25" type="box" '
                'size="0.1 0.2 0.3"/><default class="inner"><joint damping="0.3"/></default></default>'
                '<default class="light"><geom type="capsule" size="0.05 0.2"/></default></default>')

    def pose(self):
        """Return the attributes of a random pose: its place and how it is turned."""
        random, text = self.random, ''
        kind = random.choice(['', 'quat', 'axisangle', 'euler', 'xyaxes', 'zaxis'])
        if kind == 'quat':
            text = f'quat="{digits(random.normal(0, 1, 4))}"'
        elif kind == 'axisangle':
            text = f'axisangle="{digits(random.normal(0, 1, 3), random.normal(0, 90 if self.degrees else 2))}"'
        elif kind == 'euler':
            text = f'euler="{digits(random.normal(0, 90 if self.degrees else 2, 3))}"'
        elif kind == 'xyaxes':
            text = f'xyaxes="{digits(random.normal(0, 1, 6))}"'
        elif kind == 'zaxis':
            text = f'zaxis="{digits(self.random.choice([0.0, 1.0], 3) if random.random() < 0.1 else self.unit())}"'
            text = text if '0.0 0.0 0.0' not in text else ''
        return f'pos="{digits(random.normal(0, 0.4, 3))}" {text}'

    def turn(self, pose):
        """Return the rotation matrix that MuJoCo makes of the attributes of a pose."""
        model = mujoco.MjModel.from_xml_string(f'<mujoco><compiler {self.compiler_pose}/><worldbody><body {pose}/>'
                                               '</worldbody></mujoco>')
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_quat[1])
        return turn.reshape(3, 3)

    def body(self, turn, depth):
        random = self.random
        self.bodies += 1
        name = f'b{self.bodies}'
        pose = self.pose()
        turn = turn @ self.turn(pose)
        childclass = random.choice(['', '', ' childclass="heavy"', ' childclass="inner"', ' childclass="light"'])
        parts = [self.joint(turn) for _ in range(random.choice([0, 1, 1, 1, 1, 2, 3]))]
        parts += [self.geom() for _ in range(random.integers(1, 4))]
        if random.random() < 0.3:
            parts.append(self.inertial())
        if random.random() < 0.3:
            frame = self.pose()
            frame_turn = self.turn(frame)
            parts.append(f'<frame {frame}>{self.geom()}{self.joint(turn @ frame_turn)}'
                         f'{self.body(turn @ frame_turn, depth + 1) if depth < 2 else ""}</frame>')
        parts += [self.body(turn, depth + 1) for _ in range(random.integers(0, 3) if depth < 2 else 0)]
        random.shuffle(parts)
        return f'<body name="{name}" {pose}{childclass}>{"".join(parts)}</body>'

    def joint(self, turn):
        random = self.random
        self.joints += 1
        if random.random() < 0.6:
            axis, kind = turn.T @ self.normal * random.choice([-1.0, 1.0, 3.0]), random.choice(['', ' type="hinge"'])
        else:
            across = self.normal if random.random() < 0.15 else np.cross(self.normal, self.unit())   # of a SCARA
            axis, kind = turn.T @ (across / np.linalg.norm(across)), ' type="slide"'
        says = {'pos': digits(random.normal(0, 0.3, 3)) if random.random() < 0.5 else None, 'axis': digits(axis)}
        scale = 60.0 if self.degrees else 1.0
        for key, value in (('ref', random.normal(0, scale)), ('springref', random.normal(0, scale)),
                           ('stiffness', random.uniform(0, 5)), ('damping', random.uniform(0, 1)),
                           ('armature', random.uniform(0, 0.5))):
            says[key] = digits(value) if random.random() < 0.3 else None
        if random.random() < 0.9:     # without rotors, several joints in one body make a singular matrix
            says['armature'] = digits(random.uniform(0.2, 1.0))
        if random.random() < 0.3:
            says['range'] = digits(sorted(random.normal(0, 2 * scale, 2)))
        if random.random() < 0.2:
            says['class'] = random.choice(['heavy', 'light', 'inner', 'main'])
        return (f'<joint name="j{self.joints}"{kind} ' + ' '.join(
            f'{key}="{value}"' for key, value in says.items() if value) + '/>')

    def geom(self):
        random = self.random
        kind = str(random.choice([*SHAPES, 'default']))
        pose = self.pose()
        small = 0.1 if self.contacts else 1.0
        says = [f'group="{random.integers(0, 5)}"'] if random.random() < 0.3 else []
        if random.random() < 0.5:
            says.append(random.choice([f'mass="{digits(random.uniform(0.1, 2))}"',
                                       f'density="{digits(random.uniform(100, 3000))}"']))
        if random.random() < 0.2:
            says.append(f'class="{random.choice(["heavy", "light", "inner", "main"])}"')
        if kind == 'default':
            says.append(f'size="{digits(small * random.uniform(0.05, 0.4, 3))}"')
        elif kind != 'sphere' and random.random() < 0.4:
            says += [f'type="{kind}"', f'fromto="{digits(small * random.normal(0, 0.4, 6))}"',
                     f'size="{digits(small * random.uniform(0.02, 0.2))}"']
            pose = ''
        else:
            says += [f'type="{kind}"', f'size="{digits(small * random.uniform(0.05, 0.4, 3))}"']
        if self.contacts:
            says.append(random.choice(['contype="0"', 'conaffinity="0"', 'contype="0" conaffinity="0"',
                                       'margin="0.01"']))
        return f'<geom {pose} {" ".join(says)}/>'

    def inertial(self):
        random = self.random
        pose = self.pose()
        mass = f'mass="{digits(random.uniform(0.2, 3))}"'
        if random.random() < 0.5:
            a, b = random.uniform(0.05, 0.3, 2)
            return f'<inertial {pose} {mass} diaginertia="{digits(a, b, random.uniform(abs(a - b), a + b))}"/>'
        moments = random.uniform(0.1, 0.19, 3)
        turn = np.linalg.qr(random.normal(0, 1, (3, 3)))[0]
        full = (turn * moments) @ turn.T
        values = full[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        return f'<inertial pos="{digits(random.normal(0, 0.3, 3))}" {mass} fullinertia="{digits(values)}"/>'
