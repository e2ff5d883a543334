"""Two other ways to solve what the interior-point kernel solves: a dense Newton system, and Clarabel."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy.sparse as sp
from kernel_calls import from_python

from landing_cli.optimize.conic_ipm import (
    ROW_REGULARISATION,
    advance,
    fill_row_pull as fill_row_pull_part,
    residuals,
)
from landing_cli.optimize.conic_records import Model, Point, new_step

fill_row_pull = from_python(fill_row_pull_part)

JORDAN = np.diag([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Sizes:
    """Numbers of nodes, cones and rows, and the kind of problem."""

    nodes: int
    cones: int
    equal: int
    rows: int
    tau_free: bool


def copy_of(point: Point) -> Point:
    return Point(*(a.copy() for a in point))


def rows_on_thrust(model: Model) -> np.ndarray:
    """Derivatives of the rows by all thrust nodes, (R, 3 N), zero beyond a row's end."""
    n = len(model.basis)
    within = np.arange(n)[None, :] < model.row_end[:, None]
    return np.einsum("rb,kbi,rk->rki", model.row_mix, model.basis, within).reshape(-1, 3 * n)


def spectral(x: np.ndarray, function) -> np.ndarray:
    """A function of a cone's element by its spectral decomposition."""
    size = np.linalg.norm(x[1:])
    high, low = function(x[0] + size), function(x[0] - size)
    return np.array([0.5 * (high + low), *(0.5 * (high - low) * x[1:] / size)])


def quadratic(x: np.ndarray) -> np.ndarray:
    """The quadratic representation P(x) = 2 x x' - det(x) J."""
    return 2 * np.outer(x, x) - (x @ JORDAN @ x) * JORDAN


def nesterov_todd(s: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The scaling W = W' with W z = W^-1 s, by way of square roots in the Jordan algebra."""
    root = quadratic(spectral(s, np.sqrt))
    scaling_point = root @ spectral(root @ z, lambda t: t**-0.5)
    return quadratic(spectral(scaling_point, np.sqrt))


def arrow(x: np.ndarray) -> np.ndarray:
    """The matrix of the Jordan product with x."""
    out = x[0] * np.eye(4)
    out[0, 1:] = out[1:, 0] = x[1:]
    return out


class DenseNewton:
    """The whole linearised system of optimality conditions, every cone with its own slack and dual."""

    def __init__(self, point: Point, model: Model, sizes: Sizes) -> None:
        self.point, self.model, self.sizes = point, model, sizes
        n, j, r = sizes.nodes, sizes.cones, sizes.rows
        counts = {"F": 3 * n, "zn": 4 * n, "y": 7, "s": 4 * j, "z": 4 * j, "l": r, "t": r - sizes.equal}
        ends = np.cumsum(list(counts.values()))
        self.part = {k: slice(e - c, e) for (k, c), e in zip(counts.items(), ends, strict=True)}
        self.size = int(ends[-1])
        to_node = np.zeros((4 * n, 3 * n))
        for k in range(n):
            to_node[4 * k + 1 : 4 * k + 4, 3 * k : 3 * k + 3] = np.eye(3)
        tau = np.zeros((4 * n, 7))
        tau[::4, 0] = 1.0
        self.maps = {
            "node_F": to_node,
            "node_y": tau,
            "cone_y": model.cone_map.reshape(4 * j, 7),
            "row_F": rows_on_thrust(model),
        }
        self.node_slack = np.column_stack([np.full(n, point.y[0]), point.thrust])

    def residuals(self) -> dict[str, np.ndarray]:
        """The optimality conditions at the point, from their definitions."""
        p, m, maps = self.point, self.model, self.maps
        on_thrust = m.thrust_gradient.ravel() + maps["row_F"].T @ p.multiplier
        on_y = m.y_gradient + m.row_y.T @ p.multiplier
        for name, dual in (("node", p.node_dual), ("cone", p.cone_dual)):
            on_y = on_y - maps[f"{name}_y"].T @ dual.ravel()
        if not self.sizes.tau_free:
            on_y[0] = 0.0
        rows = m.row_value - np.where(np.arange(len(p.slack)) < self.sizes.equal, 0.0, p.slack)
        cones = maps["cone_y"] @ p.y + m.cone_offset.ravel() - p.cone_slack.ravel()
        return {
            "F": on_thrust - maps["node_F"].T @ p.node_dual.ravel(),
            "y": on_y,
            "rows": rows,
            "cones": cones,
        }

    def gap(self) -> float:
        p, e = self.point, self.sizes.equal
        nodes = np.sum(self.node_slack * p.node_dual) + np.sum(p.cone_slack * p.cone_dual)
        return float(nodes - p.slack[e:] @ p.multiplier[e:])

    def direction(self, target: float, affine: dict[str, np.ndarray] | None) -> dict[str, np.ndarray]:
        """Solve for the direction that aims at ``target``, with Mehrotra's term of an affine direction."""
        p, m, part, maps, e = self.point, self.model, self.part, self.maps, self.sizes.equal
        n, j, r = self.sizes.nodes, self.sizes.cones, self.sizes.rows
        left, right = np.zeros((self.size, self.size)), np.zeros(self.size)
        res = self.residuals()
        row = 0

        def equation(terms: dict[str, np.ndarray], value: np.ndarray) -> None:
            nonlocal row
            for name, block in terms.items():
                left[row : row + len(value), part[name]] = block
            right[row : row + len(value)] = value
            row += len(value)

        curvature = np.diag(np.repeat(m.thrust_curvature, 3))
        equation({"F": curvature, "l": maps["row_F"].T, "zn": -maps["node_F"].T}, -res["F"])
        on_y = {"y": m.y_hessian.copy(), "l": m.row_y.T.copy()}
        on_y |= {"zn": -maps["node_y"].T, "z": -maps["cone_y"].T.copy()}
        if not self.sizes.tau_free:
            for block in on_y.values():
                block[0] = 0.0
            on_y["y"][0, 0] = 1.0
        equation(on_y, -res["y"])
        bent = -ROW_REGULARISATION * np.diag(1.0 * ((m.row_end == 0) & (np.arange(r) < e)))
        slack = -np.eye(r)[:, e:]
        equation({"F": maps["row_F"], "y": m.row_y, "l": bent, "t": slack}, -res["rows"])
        equation({"y": maps["cone_y"], "s": -np.eye(4 * j)}, -res["cones"])
        for k in range(n + j):
            node, c = k < n, k if k < n else k - n
            s = self.node_slack[c] if node else p.cone_slack[c]
            z = p.node_dual[c] if node else p.cone_dual[c]
            W = nesterov_todd(s, z)
            inverse = np.linalg.inv(W)
            product, point = arrow(W @ z), W @ z
            value = target * np.eye(4)[0] - product @ point
            if affine is not None:
                ds, dz = (
                    (affine["node_s"][c], affine["zn"].reshape(-1, 4)[c])
                    if node
                    else (affine["s"].reshape(-1, 4)[c], affine["z"].reshape(-1, 4)[c])
                )
                value -= arrow(inverse @ ds) @ W @ dz
            rows4 = slice(4 * c, 4 * c + 4)
            on_dual = np.zeros((4, 4 * (n if node else j)))
            on_dual[:, rows4] = product @ W
            if node:
                terms = {
                    "F": product @ inverse @ maps["node_F"][rows4],
                    "y": product @ inverse @ maps["node_y"][rows4],
                    "zn": on_dual,
                }
            else:
                on_slack = np.zeros((4, 4 * j))
                on_slack[:, rows4] = product @ inverse
                terms = {"s": on_slack, "z": on_dual}
            equation(terms, value)
        eta = -p.multiplier[e:]
        value = target - p.slack[e:] * eta
        if affine is not None:
            value = value + affine["t"] * affine["l"][e:]
        on_multiplier = np.zeros((r - e, r))
        on_multiplier[:, e:] = -np.diag(p.slack[e:])
        equation({"t": np.diag(eta), "l": on_multiplier}, value)
        assert row == self.size
        solution = np.linalg.solve(left, right)
        out = {name: solution[where] for name, where in part.items()}
        out["node_s"] = np.column_stack([np.full(n, out["y"][0]), out["F"].reshape(n, 3)])
        return out

    def longest(self, d: dict[str, np.ndarray]) -> float:
        """The longest step that stays in every cone, by bisection."""
        p, e = self.point, self.sizes.equal
        pairs = [(self.node_slack, d["node_s"]), (p.node_dual, d["zn"].reshape(-1, 4))]
        pairs += [(p.cone_slack, d["s"].reshape(-1, 4)), (p.cone_dual, d["z"].reshape(-1, 4))]
        low, high = 0.0, 1e3
        for _ in range(100):
            t = 0.5 * (low + high)
            moved = [a + t * b for a, b in pairs]
            inside = all(np.all(x[:, 0] >= np.linalg.norm(x[:, 1:], axis=1)) for x in moved)
            inside &= bool(np.all(p.slack[e:] + t * d["t"] >= 0))
            inside &= bool(np.all(p.multiplier[e:] + t * d["l"][e:] <= 0))
            low, high = (t, high) if inside else (low, t)
        return low


def iterate(point: Point, model: Model, sizes: Sizes, most: int = 80) -> tuple[float, int]:
    """Solve the frozen problem in place; return the least objective and the number of iterations.

    The objective is that of a quadratic whose value at the starting point is zero.
    """
    fixed = Model(*(a.copy() for a in model))
    start = copy_of(point)
    rows = rows_on_thrust(model)
    step = new_step(sizes.nodes, sizes.cones, sizes.rows, model.basis.shape[1])
    counts = sizes.equal, sizes.rows, sizes.cones
    taken = 0
    while True:
        d_thrust, d_y = point.thrust - start.thrust, point.y - start.y
        on_thrust, on_y = model.thrust_curvature[:, None] * d_thrust, model.y_hessian @ d_y
        model.row_value[:] = fixed.row_value + rows @ d_thrust.ravel() + model.row_y @ d_y
        model.thrust_gradient[:] = fixed.thrust_gradient + on_thrust
        model.y_gradient[:] = fixed.y_gradient + on_y
        fill_row_pull(point, model, sizes.rows)
        primal, dual, gap = residuals(point, model, step, *counts, sizes.tau_free)
        if (max(primal, gap) < 1e-7 and dual < 1e-5) or taken == most:
            break
        advance(point, model, step, *counts, gap, 1e-9, sizes.tau_free)
        taken += 1
    objective = np.sum((fixed.thrust_gradient + 0.5 * on_thrust) * d_thrust)
    return float(objective + (fixed.y_gradient + 0.5 * on_y) @ d_y), taken


class ByClarabel:
    """The same frozen problem given to Clarabel, in the unknowns' distance from the starting point."""

    def __init__(self, point: Point, model: Model, sizes: Sizes) -> None:
        n, j, r, e = sizes.nodes, sizes.cones, sizes.rows, sizes.equal
        thrust_size = 3 * n
        hessian = sp.block_diag([sp.diags(np.repeat(model.thrust_curvature, 3)), model.y_hessian])
        gradient = np.concatenate([model.thrust_gradient.ravel(), model.y_gradient])
        rows = np.hstack([rows_on_thrust(model), model.row_y])
        blocks, offsets = [rows], [model.row_value]
        cones = [clarabel.ZeroConeT(e), clarabel.NonnegativeConeT(r - e)]
        if not sizes.tau_free:
            fixed = np.zeros((1, thrust_size + 7))
            fixed[0, thrust_size] = 1.0
            blocks.append(fixed)
            offsets.append(np.zeros(1))
            cones.append(clarabel.ZeroConeT(1))
        for k in range(n):
            block = np.zeros((4, thrust_size + 7))
            block[0, thrust_size] = 1.0
            block[1:, 3 * k : 3 * k + 3] = np.eye(3)
            blocks.append(block)
            offsets.append(np.array([point.y[0], *point.thrust[k]]))
        for c in range(j):
            blocks.append(np.hstack([np.zeros((4, thrust_size)), model.cone_map[c]]))
            offsets.append(model.cone_offset[c] + model.cone_map[c] @ point.y)
        cones += [clarabel.SecondOrderConeT(4)] * (n + j)
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9
        left = sp.csc_matrix(-np.vstack(blocks))
        right = np.concatenate(offsets)
        solver = clarabel.DefaultSolver(
            sp.triu(sp.csc_matrix(hessian)).tocsc(), gradient, left, right, cones, settings
        )
        found = solver.solve()
        assert str(found.status) == "Solved", found.status
        x, z = np.array(found.x), np.array(found.z)
        self.objective = found.obj_val
        self.thrust = point.thrust + x[:thrust_size].reshape(n, 3)
        self.y = point.y + x[thrust_size:]
        self.multiplier = -z[:r]
        first = r + (0 if sizes.tau_free else 1)
        self.node_dual = z[first : first + 4 * n].reshape(n, 4)
        self.cone_dual = z[first + 4 * n :].reshape(j, 4)
