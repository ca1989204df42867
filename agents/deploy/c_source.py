"""A score network as C99 without dependencies: a header, a source file and test vectors."""

from __future__ import annotations

import numpy as np

from agents.deploy.agreement import CheckCases
from agents.policies import NetworkPolicy, linear_layers, weights_in_blocks, widths_of

HEADER, SOURCE, VECTORS = "shotenv_policy.h", "shotenv_policy.c", "shotenv_vectors.h"


def c_header(policy: NetworkPolicy) -> str:
    """The header: what a camera calls, and the features in their order."""
    names = policy.feature_names
    order = "\n".join(f" * {number:3} {name}" for number, name in enumerate(names))
    return f"""/* Scheduler of a time-of-flight camera, written by `shotenv export`.
 *
 * C99, no dependencies but tanhf of the C library's libm (none with relu), no memory but the stack.
 * Trained by {_comment(policy.provenance.algorithm)}. Features, clipped to [-2, 2], in order:
{order}
 */
#ifndef SHOTENV_POLICY_H
#define SHOTENV_POLICY_H

#ifdef __cplusplus
extern "C" {{
#endif

#define SHOTENV_FEATURES {len(names)}
#define SHOTENV_ACTIONS 3

/* Names of the features, in order. */
extern const char *const shotenv_feature_names[SHOTENV_FEATURES];

/* Samples of each action: 2, 4, 8. */
extern const int shotenv_samples[SHOTENV_ACTIONS];

/* Score of each action; the highest is the best. */
void shotenv_scores(const float observation[SHOTENV_FEATURES], float scores[SHOTENV_ACTIONS]);

/* The best action of those allowed (not 0), the first of equals; action 0 if none is allowed. */
int shotenv_choose(const float observation[SHOTENV_FEATURES],
                   const unsigned char allowed[SHOTENV_ACTIONS]);

#ifdef __cplusplus
}}
#endif

#endif
"""


def c_source(policy: NetworkPolicy) -> str:
    """The source: weights, the network, and a test of it behind `SHOTENV_SELF_TEST`."""
    layers, widths = linear_layers(policy.network), widths_of(policy.network)
    weights, steps, seen = "", [], "observation"
    for n, layer in enumerate(layers):
        each, last = weights_in_blocks(layer), n == len(layers) - 1
        blocks, outputs, inputs = each.shape
        weights += (
            f"static const float weight{n}[{blocks * outputs}][{inputs}] = "
            f"{_matrix(each.flatten(0, 1).numpy())};\n"
            f"static const float bias{n}[{layer.out_features}] = {_row(layer.bias.numpy())};\n\n"
        )
        out = "scores" if last else f"hidden{n}"
        steps.append(
            f"    linear(&weight{n}[0][0], bias{n}, {seen}, {inputs}, {out}, {outputs}, {blocks}, "
            f"{int(not last)});"
        )
        seen = out
    memory = "\n".join(f"    float hidden{n}[{w}];" for n, w in enumerate(widths[1:-1]))
    uses_tanh = policy.activation == "tanh" and len(layers) > 1
    bent = "tanhf(sum)" if uses_tanh else "(sum > 0.0f ? sum : 0.0f)"
    names = ",\n".join(f'    "{name}"' for name in policy.feature_names)
    include = "#include <math.h>\n\n" if uses_tanh else ""
    return f"""#include "{HEADER}"

{include}{weights}const char *const shotenv_feature_names[SHOTENV_FEATURES] = {{
{names}
}};

const int shotenv_samples[SHOTENV_ACTIONS] = {{2, 4, 8}};

/* Each block of outputs reads a block of inputs of its own; the sizes are those of one block. */
static void linear(const float *weight, const float *bias, const float *in, int inputs,
                   float *out, int outputs, int blocks, int activated)
{{
    int i, j;
    for (j = 0; j < blocks * outputs; ++j) {{
        const float *read = in + j / outputs * inputs;
        float sum = bias[j];
        for (i = 0; i < inputs; ++i)
            sum += weight[j * inputs + i] * read[i];
        out[j] = activated ? {bent} : sum;
    }}
}}

void shotenv_scores(const float observation[SHOTENV_FEATURES], float scores[SHOTENV_ACTIONS])
{{
{memory}
{chr(10).join(steps)}
}}

int shotenv_choose(const float observation[SHOTENV_FEATURES],
                   const unsigned char allowed[SHOTENV_ACTIONS])
{{
    float scores[SHOTENV_ACTIONS];
    int action, best = -1;
    shotenv_scores(observation, scores);
    for (action = 0; action < SHOTENV_ACTIONS; ++action)
        if (allowed[action] && (best < 0 || scores[action] > scores[best]))
            best = action;
    return best < 0 ? 0 : best;
}}
{SELF_TEST}"""


# Prints failures and microseconds; the repeats are what the clock of small systems can resolve.
SELF_TEST = f"""
#ifdef SHOTENV_SELF_TEST
#include <stdio.h>
#include <time.h>

#include "{VECTORS}"

int main(void)
{{
    int n, k, failures = 0, repeats = 200;
    long sum = 0;
    clock_t start;
    for (n = 0; n < SHOTENV_VECTORS; ++n) {{
        float scores[SHOTENV_ACTIONS];
        shotenv_scores(shotenv_observations[n], scores);
        for (k = 0; k < SHOTENV_ACTIONS; ++k) {{
            float expected = shotenv_expected_scores[n][k], apart = scores[k] - expected;
            float size = expected < 0.0f ? -expected : expected;
            if (!(apart < 1e-4f * (1.0f + size) && -apart < 1e-4f * (1.0f + size)))
                ++failures;
        }}
        if (shotenv_choose(shotenv_observations[n], shotenv_allowed[n]) != shotenv_expected[n])
            ++failures;
    }}
    start = clock();
    for (k = 0; k < repeats; ++k)
        for (n = 0; n < SHOTENV_VECTORS; ++n)
            sum += shotenv_choose(shotenv_observations[n], shotenv_allowed[n]);
    printf("%d vectors, %d failures, %.4f microseconds per choice (sum %ld)\\n", SHOTENV_VECTORS,
           failures, 1e6 * (double)(clock() - start) / CLOCKS_PER_SEC / repeats / SHOTENV_VECTORS,
           sum);
    return failures != 0;
}}
#endif
"""


def c_vectors(cases: CheckCases) -> str:
    """Observations with the scores and actions that torch gives."""
    count, features = cases.observations.shape
    actions = ", ".join(map(str, cases.actions))
    return f"""/* Test vectors: compile {SOURCE} with -DSHOTENV_SELF_TEST and run it. */
#define SHOTENV_VECTORS {count}
static const float shotenv_observations[{count}][{features}] = {_matrix(cases.observations)};
static const unsigned char shotenv_allowed[{count}][3] = {{
{_lines("{" + ", ".join(str(int(a)) for a in row) + "}" for row in cases.allowed)}
}};
static const float shotenv_expected_scores[{count}][3] = {_matrix(cases.scores)};
static const int shotenv_expected[{count}] = {{{actions}}};
"""


def _matrix(rows: np.ndarray) -> str:
    return "{\n" + _lines(_row(row) for row in rows) + "\n}"


def _lines(rows) -> str:
    return ",\n".join(rows)


def _row(values: np.ndarray) -> str:
    return "{" + ", ".join(_literal(value) for value in values) + "}"


def _literal(value: float) -> str:
    """A float32 as a C literal that is read back to the same bits: nine digits suffice."""
    text = f"{value:.9g}"
    return text + ("f" if set(text) & set(".e") else ".0f")


def _comment(text: str) -> str:
    """`text` as it may stand in a comment of C: nothing in it ends the comment."""
    return "".join(c for c in text if c.isalnum() or c in " -_.+")
