// Recipe `paper`: Dice of the background, the neighbour term, Adam without limits. `log_scale` holds logits, scales are
// scale_limit * sigmoid(logit); the opacity stays.

constexpr int POSED = 10, COLUMNS = 10;  // of a posed gaussian: place, quaternion, scales; what is compared: the last two and colour

// One block. Sums of the batch's tiles to the slope of Dice by alpha, for a loss that is a mean over the frames, and its value.
extern "C" __global__ void __launch_bounds__(256) dice(Scene s) {
    __shared__ float scratch[8];
    if (halted(s)) return;
    int tid = threadIdx.x;
    double sums[4] = {};
    for (int b = 0; b < s.batch; ++b)
        for (int t = tid; t < s.now[b].columns * s.now[b].rows; t += 256)
            if (s.near_flag[b * s.max_tiles + t])
                for (int k = 0; k < 4; ++k) sums[k] += s.overlap[4 * (b * s.max_tiles + t) + k];
    for (int k = 0; k < 4; ++k) {
        __syncthreads();
        sums[k] = sum_block(float(sums[k]), scratch);
    }
    if (tid > 0) return;
    Dice found = dice_of(double(s.area) * s.batch, sums[0], sums[1], sums[2], sums[3], s.dice_weight);
    s.dice[0] = float(found.by_clear * s.batch);
    s.dice[1] = float(found.value);
}

FORMULA long long fixed_of(float v) { return __double2ll_rn(double(v) / PULL_UNIT); }
FORMULA void add_fixed(long long *to, float v) { atomicAdd((unsigned long long *)to, (unsigned long long)fixed_of(v)); }

// (blocks of gaussians, batch). The gaussian as it is posed, the box around the block's, and no pull yet.
extern "C" __global__ void __launch_bounds__(128) pose_gaussians(Scene s) {
    __shared__ float low[4][3], high[4][3];
    if (halted(s)) return;
    int b = blockIdx.y, i = min(int(blockIdx.x) * 128 + int(threadIdx.x), s.count - 1), lane = threadIdx.x % 32, warp = threadIdx.x / 32;
    Posed g = posed(s, b, i);
    size_t at = size_t(b) * s.count + i;
    float *to = s.posed + POSED * at, place[3] = {g.bound.mean.x, g.bound.mean.y, g.bound.mean.z};
    quat_of(g.bound.column, to + 3);
    for (int c = 0; c < 3; ++c) {
        to[c] = place[c];
        to[7 + c] = g.bound.scale[c];
    }
    for (int c = 0; c < 13; ++c) s.pull[13 * at + c] = 0;
    if (i == 0) s.pull_value[b] = 0;
    for (int c = 0; c < 3; ++c) {
        float least = place[c], most = place[c];
        for (int step = 16; step > 0; step /= 2) {
            least = fminf(least, __shfl_xor_sync(~0u, least, step));
            most = fmaxf(most, __shfl_xor_sync(~0u, most, step));
        }
        if (lane == 0) {
            low[warp][c] = least;
            high[warp][c] = most;
        }
    }
    __syncthreads();
    if (threadIdx.x >= 3) return;
    int c = threadIdx.x;
    float *hull = s.hull + 6 * (size_t(b) * gridDim.x + blockIdx.x);
    hull[c] = fminf(fminf(low[0][c], low[1][c]), fminf(low[2][c], low[3][c]));
    hull[3 + c] = fmaxf(fmaxf(high[0][c], high[1][c]), fmaxf(high[2][c], high[3][c]));
}

FORMULA float square_between(Vec<float> a, Vec<float> b) {
    float x = a.x - b.x, y = a.y - b.y, z = a.z - b.z;
    return x * x + y * y + z * z;
}

FORMULA float outside(float v, float low, float high) { return fmaxf(fmaxf(low - v, v - high), 0); }

// (blocks of gaussians, batch). The nearest posed gaussians, itself among them. Blocks whose box is farther than the neighbours of
// the step before (-1: none known) are passed over.
extern "C" __global__ void __launch_bounds__(128) nearest(Scene s) {
    __shared__ float there[128][3];
    if (halted(s)) return;
    int b = blockIdx.y, i = blockIdx.x * 128 + threadIdx.x, own = min(i, s.count - 1), found[NEAREST] = {};
    const float *posed = s.posed + POSED * size_t(b) * s.count;
    int *index = s.nearest_gaussian + NEAREST * (size_t(b) * s.count + own);
    Vec<float> at = vec(posed + POSED * own);
    float least[NEAREST] = {1e30f, 1e30f, 1e30f}, bound = 0;
    for (int k = 0; k < NEAREST; ++k) bound = index[k] < 0 ? 1e30f : fmaxf(bound, square_between(at, vec(posed + POSED * index[k])));
    for (int block = 0; block < int(gridDim.x); ++block) {
        const float *hull = s.hull + 6 * (size_t(b) * gridDim.x + block);
        float x = outside(at.x, hull[0], hull[3]), y = outside(at.y, hull[1], hull[4]), z = outside(at.z, hull[2], hull[5]);
        bool wanted = x * x + y * y + z * z <= fminf(bound, least[2]);
        if (!__syncthreads_or(wanted)) continue;
        int base = block * 128, here = min(128, s.count - base);
        if (threadIdx.x < here)
            for (int c = 0; c < 3; ++c) there[threadIdx.x][c] = posed[POSED * (base + threadIdx.x) + c];
        __syncthreads();
        for (int k = 0; wanted && k < here; ++k) {
            float square = square_between(at, vec(there[k]));
            if (square > bound || square >= least[2]) continue;
            least[2] = square;
            found[2] = base + k;
            for (int m = 2; m > 0; --m)
                if (least[m] < least[m - 1]) {
                    float far = least[m - 1];
                    int other = found[m - 1];
                    least[m - 1] = least[m];
                    found[m - 1] = found[m];
                    least[m] = far;
                    found[m] = other;
                }
        }
    }
    if (i < s.count)
        for (int k = 0; k < NEAREST; ++k) index[k] = found[k];
}

// (blocks of gaussians, batch). Value of the term and its gradient by what the gaussians of the neighbourhood are, as posed.
extern "C" __global__ void __launch_bounds__(128) neighbourhood(Scene s) {
    __shared__ float scratch[4];
    if (halted(s)) return;
    int b = blockIdx.y, i = blockIdx.x * 128 + threadIdx.x;
    float value = 0;
    if (i < s.count) {
        const float *posed = s.posed + POSED * size_t(b) * s.count;
        long long *pull = s.pull + 13 * size_t(b) * s.count;
        const int *index = s.nearest_gaussian + NEAREST * (size_t(b) * s.count + i);
        for (int c = 0; c < COLUMNS; ++c) {
            float column[NEAREST], mean, slope, weight = s.knn / (float(s.count) * (c < 4 ? 4 : 3));
            for (int k = 0; k < NEAREST; ++k) column[k] = c < 7 ? posed[POSED * index[k] + 3 + c] : s.rgb[3 * index[k] + c - 7];
            value += weight * spread(column, weight, mean, slope);
            for (int k = 0; k < NEAREST; ++k) add_fixed(pull + 13 * index[k] + 3 + c, slope * (column[k] - mean));
        }
        float share = s.knn / (float(NEAREST) * s.count), total[3] = {};
        for (int k = 0; k < NEAREST; ++k)
            for (int c = 0; c < 3; ++c) {
                float away = posed[POSED * i + c] - posed[POSED * index[k] + c];
                value += share * away * away;
                total[c] += 2 * share * away;
                add_fixed(pull + 13 * index[k] + c, -2 * share * away);
            }
        for (int c = 0; c < 3; ++c) add_fixed(pull + 13 * i + c, total[c]);
    }
    value = sum_block(value, scratch);
    if (threadIdx.x == 0) add_fixed(s.pull_value + b, value);
}

// Adam of some numbers of a gaussian, from its `row` of the moments on.
FORMULA void adam_all(const Scene &s, int i, int row, float *value, const float *grad, int size, float rate, float unbias) {
    for (int c = 0; c < size; ++c) {
        size_t at = size_t(row + c) * s.count + i;
        adam_value(value[c], grad[c], s.first[at], s.second[at], rate, unbias);
    }
}

// (blocks of gaussians). The gradient of images and neighbours, then Adam.
extern "C" __global__ void __launch_bounds__(128) paper_step(Scene s) {
    if (halted(s)) return;
    int i = blockIdx.x * 128 + threadIdx.x;
    if (i >= s.count) return;
    const Plan plan = s.now[0].plan;
    Slopes g = slopes_of(s, i);
    for (int c = 0; c < 3; ++c) g.log_scale[c] *= log_scale_slope(s.log_scale[3 * i + c]);
    double n = s.state->step + 1;
    float begun = float(1 / (1 - pow(0.9, n))), unbias = float(1 / (1 - pow(0.999, n)));
    adam_all(s, i, 0, s.mu + 3 * i, g.mu, 3, plan.mu * begun, unbias);
    adam_all(s, i, 3, s.quat + 4 * i, g.quat, 4, plan.quat * begun, unbias);
    adam_all(s, i, 7, s.log_scale + 3 * i, g.log_scale, 3, plan.log_scale * begun, unbias);
    adam_all(s, i, 10, s.rgb + 3 * i, g.rgb, 3, plan.rgb * begun, unbias);
}
