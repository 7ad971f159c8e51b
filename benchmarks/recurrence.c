/* The recurrence of Eq. 16 for all ordered pairs, plainly in C: the yardstick of benchmarks/speed.py.
 *
 * x and y hold n performances each of P frames x K features; y transposed, (n, K, P), so that a
 * compiler can vectorise along the band. Steps 0, 1, 2; penalty mu for steps 0 and 2. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEFINE(NAME, REAL)                                                                     \
    void NAME(const REAL *restrict x, const REAL *restrict yt, REAL *restrict out, int n,      \
              int P, int K, int D, REAL mu)                                                    \
    {                                                                                          \
        const int width = 2 * D + 1;                                                           \
        const int pitch = (width + 2 + 15) / 16 * 16;                                          \
        REAL *rows = aligned_alloc(64, sizeof(REAL) * 3 * pitch);                              \
        for (int a = 0; a < n; a++)                                                            \
            for (int b = 0; b < n; b++) {                                                      \
                REAL *old = rows, *new = rows + pitch;                                         \
                REAL *restrict cost = rows + 2 * pitch;                                        \
                for (int i = 0; i < 2 * pitch; i++)                                            \
                    rows[i] = INFINITY;                                                        \
                for (int p = 0; p < P; p++) {                                                  \
                    int low = -D, high = D;                                                    \
                    if (low < -p) low = -p;                                                    \
                    if (high > p) high = p;                                                    \
                    if (low < p + 1 - P) low = p + 1 - P;                                      \
                    if (high > P - 1 - p) high = P - 1 - p;                                    \
                    const int length = high - low + 1;                                         \
                    memset(cost, 0, sizeof(REAL) * length);                                    \
                    for (int k = 0; k < K; k++) {                                              \
                        const REAL u = x[((size_t)a * P + p) * K + k];                         \
                        const REAL *v = yt + ((size_t)b * K + k) * P + p + low;                \
                        for (int i = 0; i < length; i++)                                       \
                            cost[i] += (u - v[i]) * (u - v[i]);                                \
                    }                                                                          \
                    REAL *restrict to = new + low + D + 1;                                     \
                    const REAL *restrict from = old + low + D + 1;                             \
                    if (p == 0)                                                                \
                        to[0] = cost[0];                                                       \
                    else                                                                       \
                        for (int i = 0; i < length; i++) {                                     \
                            const REAL l = from[i - 1], r = from[i + 1], s = from[i];          \
                            const REAL change = (l < r ? l : r) + mu;                          \
                            to[i] = (s < change ? s : change) + cost[i];                       \
                        }                                                                      \
                    REAL *swap = old;                                                          \
                    old = new;                                                                 \
                    new = swap;                                                                \
                }                                                                              \
                out[(size_t)a * n + b] = old[D + 1];                                           \
            }                                                                                  \
        free(rows);                                                                            \
    }

DEFINE(all_pairs_double, double)
DEFINE(all_pairs_float, float)
