/* Gauss-Seidel sweeps over light contacts with exact local solves: what multicor_cli/engine/contact/sweep.py does, written in C as a
 * yardstick. velocity: (v_x, v_y, a*omega, 1/m) of each body; frame: (n_x, n_y, 1/W_nn, bias, mu) of each contact. */
#include <stddef.h>
#include <stdint.h>

static double sweep(ptrdiff_t count, double beta, double *restrict velocity, const int32_t *restrict pair, const double *restrict frame,
                    double *restrict impulse)
{
    const double turn = 1.0 + beta, less = 1.0 / turn;
    double total = 0.0;
    for (ptrdiff_t k = 0; k < count; k++) {
        double *a = velocity + 4 * (size_t)pair[2 * k], *b = velocity + 4 * (size_t)pair[2 * k + 1];
        const double *f = frame + 5 * k;
        const double nx = f[0], ny = f[1], w = f[2], mu = f[4];
        const double dx = a[0] - b[0], dy = a[1] - b[1];
        const double un = dx * nx + dy * ny + f[3];
        const double ut = dy * nx - dx * ny - a[2] - b[2];
        const double pn = impulse[2 * k], pt = impulse[2 * k + 1];
        const double push = pn - un * w, qn = push > 0.0 ? push : 0.0;
        const double limit = mu * qn;
        const double rub = pt - ut * (w * less), below = rub < limit ? rub : limit, qt = below > -limit ? below : -limit;
        const double dn = qn - pn, dt = qt - pt;
        if (dn == 0.0 && dt == 0.0)
            continue;
        impulse[2 * k] = qn;
        impulse[2 * k + 1] = qt;
        const double px = dn * nx - dt * ny, py = dn * ny + dt * nx, spin = beta * dt, weight = a[3] + b[3];
        a[0] += a[3] * px;
        a[1] += a[3] * py;
        a[2] -= a[3] * spin;
        b[0] -= b[3] * px;
        b[1] -= b[3] * py;
        b[2] -= b[3] * spin;
        total += weight * weight * (dn * dn + turn * turn * dt * dt);
    }
    return total;
}

double sweeps(ptrdiff_t repeats, ptrdiff_t count, double beta, double *velocity, const int32_t *pair, const double *frame,
              double *impulse)
{
    double total = 0.0;
    for (ptrdiff_t r = 0; r < repeats; r++)
        total += sweep(count, beta, velocity, pair, frame, impulse);
    return total;
}
