// Recipe `paper`: Dice of the background, the neighbour term, Adam without limits. `log_scale` holds logits, scales are
// scale_limit * sigmoid(logit); the opacity stays.

constexpr int COLUMNS = 10;  // scales, quaternion, colour

// (batch). Sums of the tiles to the two slopes of Dice by alpha, and its value.
extern "C" __global__ void __launch_bounds__(256) dice(Scene s) {
    __shared__ float scratch[8];
    if (halted(s)) return;
    int b = blockIdx.x, tid = threadIdx.x, tiles = s.now[b].columns * s.now[b].rows;
    float sums[3] = {};
    for (int t = tid; t < tiles; t += 256)
        if (s.near_flag[b * s.max_tiles + t])
            for (int k = 0; k < 3; ++k) sums[k] += s.overlap[3 * (b * s.max_tiles + t) + k];
    for (int k = 0; k < 3; ++k) {
        __syncthreads();
        sums[k] = sum_block(sums[k], scratch);
    }
    if (tid > 0) return;
    Dice found = dice_of(s.area, sums[0], sums[1], sums[2], s.dice_weight);
    s.dice[3 * b] = float(found.by_clear);
    s.dice[3 * b + 1] = float(found.everywhere);
    s.dice[3 * b + 2] = float(found.value);
}

// The values of a gaussian that its neighbours are compared with.
FORMULA void columns_of(const Scene &s, int i, float *v) {
    for (int c = 0; c < 3; ++c) {
        v[c] = exp(log_scale_of(s.log_scale[3 * i + c], s.scale_limit));
        v[7 + c] = s.rgb[3 * i + c];
    }
    for (int c = 0; c < 4; ++c) v[3 + c] = s.quat[4 * i + c];
}

// (blocks of gaussians). The gaussian's place at rest, m; the means of its neighbourhood, and 1 / deviation with the term's weight.
extern "C" __global__ void __launch_bounds__(128) neighbourhood(Scene s) {
    if (halted(s)) return;
    int i = blockIdx.x * 128 + threadIdx.x;
    if (i >= s.count) return;
    const float *f = s.rest_frame + 13 * i, *mu = s.mu + 3 * i;  // rotation by rows, middle, size
    for (int c = 0; c < 3; ++c) s.place[3 * i + c] = f[9 + c] + f[12] * (f[3 * c] * mu[0] + f[3 * c + 1] * mu[1] + f[3 * c + 2] * mu[2]);
    float v[NEAREST][COLUMNS];
    for (int k = 0; k < NEAREST; ++k) columns_of(s, s.nearest_gaussian[NEAREST * i + k], v[k]);
    float *to = s.hood + 2 * COLUMNS * size_t(i);
    for (int c = 0; c < COLUMNS; ++c) {
        float column[NEAREST] = {v[0][c], v[1][c], v[2][c]};
        spread(column, s.knn / (float(s.count) * (c >= 3 && c < 7 ? 4 : 3)), to[c], to[COLUMNS + c]);
    }
}

// (blocks of gaussians). The nearest gaussians by `place`, itself among them: all pairs, a block's worth at a time.
extern "C" __global__ void __launch_bounds__(128) nearest(Scene s) {
    __shared__ float3 there[128];
    int i = blockIdx.x * 128 + threadIdx.x, own = min(i, s.count - 1), found[NEAREST] = {};
    Vec<float> at = vec(s.place + 3 * own);
    float least[NEAREST] = {1e30f, 1e30f, 1e30f};
    for (int base = 0; base < s.count; base += 128) {
        int other = min(base + int(threadIdx.x), s.count - 1), here = min(128, s.count - base);
        __syncthreads();
        there[threadIdx.x] = {s.place[3 * other], s.place[3 * other + 1], s.place[3 * other + 2]};
        __syncthreads();
        for (int k = 0; k < here; ++k) {
            float x = there[k].x - at.x, y = there[k].y - at.y, z = there[k].z - at.z, square = x * x + y * y + z * z;
            if (square >= least[2]) continue;
            least[2] = square;
            found[2] = base + k;
            for (int m = 2; m > 0; --m)
                if (least[m] < least[m - 1]) {
                    float far = least[m - 1];
                    int index = found[m - 1];
                    least[m - 1] = least[m];
                    found[m - 1] = found[m];
                    least[m] = far;
                    found[m] = index;
                }
        }
    }
    if (i < s.count)
        for (int k = 0; k < NEAREST; ++k) s.nearest_gaussian[NEAREST * i + k] = found[k];
}

// Adam of some numbers of a gaussian, from its `row` of the moments on.
FORMULA void adam_all(const Scene &s, int i, int row, float *value, const float *grad, int size, float rate, float unbias) {
    for (int c = 0; c < size; ++c) {
        size_t at = size_t(row + c) * s.count + i;
        adam_value(value[c], grad[c], s.first[at], s.second[at], rate, unbias);
    }
}

// (blocks of gaussians). The images' gradient and the neighbours', then Adam.
extern "C" __global__ void __launch_bounds__(128) paper_step(Scene s) {
    if (halted(s)) return;
    int i = blockIdx.x * 128 + threadIdx.x;
    if (i >= s.count) return;
    const Plan plan = s.now[0].plan;
    Slopes g = slopes_of(s, i);
    for (int c = 0; c < 3; ++c) g.log_scale[c] *= log_scale_slope(s.log_scale[3 * i + c]);
    Vec<float> own = vec(s.place + 3 * i), pull = {0, 0, 0};
    float v[COLUMNS], slope[COLUMNS] = {};
    columns_of(s, i, v);
    for (int k = 0; k < NEAREST; ++k) pull = pull + own - vec(s.place + 3 * s.nearest_gaussian[NEAREST * i + k]);
    for (int e = s.near_of_start[i]; e < s.near_of_start[i + 1]; ++e) {
        int other = s.near_of[e];
        const float *hood = s.hood + 2 * COLUMNS * size_t(other);
        pull = pull + own - vec(s.place + 3 * other);
        for (int c = 0; c < COLUMNS; ++c) slope[c] += hood[COLUMNS + c] * (v[c] - hood[c]);
    }
    const float *f = s.rest_frame + 13 * i;
    pull = pull * (f[12] * 2 * s.knn / (float(NEAREST) * s.count));
    for (int c = 0; c < 3; ++c) {
        g.mu[c] += f[c] * pull.x + f[3 + c] * pull.y + f[6 + c] * pull.z;
        g.log_scale[c] += slope[c] * v[c] * log_scale_slope(s.log_scale[3 * i + c]);
        g.rgb[c] += slope[7 + c];
    }
    for (int c = 0; c < 4; ++c) g.quat[c] += slope[3 + c];
    double n = s.state->step + 1;
    float begun = float(1 / (1 - pow(0.9, n))), unbias = float(1 / (1 - pow(0.999, n)));
    adam_all(s, i, 0, s.mu + 3 * i, g.mu, 3, plan.mu * begun, unbias);
    adam_all(s, i, 3, s.quat + 4 * i, g.quat, 4, plan.quat * begun, unbias);
    adam_all(s, i, 7, s.log_scale + 3 * i, g.log_scale, 3, plan.log_scale * begun, unbias);
    adam_all(s, i, 10, s.rgb + 3 * i, g.rgb, 3, plan.rgb * begun, unbias);
}
