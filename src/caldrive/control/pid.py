"""A PID controller with an explicit time step, output limits, filtered derivative and anti-windup."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PIDGains:
    """Gains in parallel form, and the limits of the output."""

    kp: float
    """Output per unit of error."""
    ki: float
    """Output per unit of error and second."""
    kd: float = 0.0
    """Output per unit of error a second."""
    low: float = -1.0
    """The least output."""
    high: float = 1.0
    """The largest output."""
    filter_time: float = 0.2
    """s, the time constant of the low pass on the derivative."""


@dataclass(frozen=True)
class PIDState:
    """What a PID remembers: its integral term in output units, the last error, the filtered derivative of the error."""

    integral: float = 0.0
    error: float | None = None
    derivative: float = 0.0


def clip(value: float, low: float, high: float) -> float:
    """The value within [low, high]."""
    return min(max(value, low), high)


def pid_step(gains: PIDGains, state: PIDState, error: float, dt: float) -> tuple[PIDState, float]:
    """One step of the parallel form kp e + ki ∫e + kd de/dt (supplement, section 1.2); dt in s.

    Anti-windup is conditional integration: while the output sits at a limit, the integral only moves away from it.
    The integral term alone never leaves the limits, nor does the output.
    """
    change = 0.0 if state.error is None else (error - state.error) / dt
    derivative = state.derivative + dt / (gains.filter_time + dt) * (change - state.derivative)
    integral = clip(state.integral + gains.ki * error * dt, gains.low, gains.high)
    rest = gains.kp * error + gains.kd * derivative
    wanted = rest + integral
    output = clip(wanted, gains.low, gains.high)
    if (wanted - output) * error > 0:
        integral = state.integral
    return PIDState(integral, error, derivative), output
