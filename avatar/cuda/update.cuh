// From moments to moved gaussians and poses.

struct Slopes {
    float mu[3], quat[4], log_scale[3], rgb[3], logit;
};

// Recipe `paper`: adds the pull of a gaussian's neighbours (paper.cuh), in frame b of the batch, to its gradient as it is posed.
FORMULA void add_pull(const Scene &s, int at, const Bound<float> &posed, Bound<float> &grad, float *rgb) {
    const long long *from = s.pull + 13 * size_t(at);
    float pull[13], q[4];
    for (int c = 0; c < 13; ++c) pull[c] = float(from[c] * PULL_UNIT);
    Vec<float> column[3] = {posed.column[0], posed.column[1], posed.column[2]};
    quat_of(column, q);
    through_quat(q, pull + 3, column);
    grad.mean = grad.mean + vec(pull);
    for (int j = 0; j < 3; ++j) {
        grad.column[j] = grad.column[j] + column[j];
        grad.scale[j] += pull[7 + j];
        rgb[j] += pull[10 + j];
    }
}

// Gradient of a gaussian: its moments summed over tiles and frames of the batch in a fixed order. Leaves those of its corners.
FORMULA Slopes slopes_of(const Scene &s, int i) {
    Slopes g = {};
    float pulled = 0, share = 1.0f / s.batch;
    int hits = 0;
    for (int b = 0; b < s.batch; ++b) {
        int at = b * s.count + i;
        ushort4 box = ((const ushort4 *)s.box)[at];
        int tiles = (box.y - box.x) * (box.w - box.z);
        float *corners = s.corner_grad + 9 * size_t(at);
        if (tiles == 0 && !s.pull) {
            for (int c = 0; c < 9; ++c) corners[c] = 0;
            continue;
        }
        float m[9] = {};
        const float *from = s.moments + 9 * size_t(s.slot_start[at]);
        for (int k = 0; k < tiles; ++k, from += 9)
#pragma unroll
            for (int c = 0; c < 9; ++c) m[c] += from[c];
        Posed own = posed(s, b, i);
        Splat<float> splat = project(own.lens, own.bound, own.opacity);
        Bound<float> bound = {};
        if (tiles) bound = project_backward(own.lens, own.bound, splat, m);
        if (s.pull) {
            float rgb[3] = {};
            add_pull(s, at, own.bound, bound, rgb);
            for (int c = 0; c < 3; ++c) g.rgb[c] += share * rgb[c];
        }
        BindGradient<float> grad = bind_backward(own.face, own.turn, own.mu, own.log_scale, bound);
        for (int c = 0; c < 3; ++c) {
            corners[3 * c] = grad.corner[c].x;
            corners[3 * c + 1] = grad.corner[c].y;
            corners[3 * c + 2] = grad.corner[c].z;
            g.log_scale[c] += share * grad.log_scale[c];
            g.rgb[c] += share * own.shade[c] * m[6 + c];
        }
        g.mu[0] += share * grad.mu.x;
        g.mu[1] += share * grad.mu.y;
        g.mu[2] += share * grad.mu.z;
        for (int c = 0; c < 4; ++c) g.quat[c] += share * grad.quat[c];
        g.logit += share * m[0] * (1 - own.opacity);  // dL/do = m / o, do/dlogit = o (1 - o)
        if (tiles && s.now[b].plan.counts) {
            float x = 2 * splat.ha * m[1] + splat.b * m[2], y = splat.b * m[1] + 2 * splat.hc * m[2];
            pulled += share * s.half_side * sqrtf(x * x + y * y);
            hits += 1;
        }
    }
    if (s.pulled) {
        s.pulled[i] += pulled;
        s.hits[i] += hits;
    }
    if (s.grad_out) {
        float *out = s.grad_out + 14 * size_t(i);
        for (int c = 0; c < 3; ++c) {
            out[c] = g.mu[c];
            out[7 + c] = g.log_scale[c];
            out[10 + c] = g.rgb[c];
        }
        for (int c = 0; c < 4; ++c) out[3 + c] = g.quat[c];
        out[13] = g.logit;
    }
    return g;
}

// (blocks of gaussians). Adam and limits of recipe `fast`.
extern "C" __global__ void __launch_bounds__(128) gaussian_step(Scene s) {
    if (halted(s)) return;
    int i = blockIdx.x * 128 + threadIdx.x;
    if (i >= s.count) return;
    const Plan plan = s.now[0].plan;
    Slopes g = slopes_of(s, i);
    if (plan.mu + plan.quat + plan.log_scale + plan.rgb + plan.opacity == 0) return;  // only poses move: the limits wait too
    if (s.resting[i]) g = {};
    int n = s.seen[i];
    if (g.rgb[0] != 0 || g.rgb[1] != 0 || g.rgb[2] != 0) s.seen[i] = ++n;
    // moments of Adam by number, so that a warp's loads lie together
    float mu[3], quat[4], log_scale[3], rgb[3], logit = s.logit[i], first[14], second[14];
    for (int c = 0; c < 14; ++c) {
        first[c] = s.first[size_t(c) * s.count + i];
        second[c] = s.second[size_t(c) * s.count + i];
    }
    for (int c = 0; c < 3; ++c) {
        mu[c] = s.mu[3 * i + c];
        log_scale[c] = s.log_scale[3 * i + c];
        rgb[c] = s.rgb[3 * i + c];
    }
    for (int c = 0; c < 4; ++c) quat[c] = s.quat[4 * i + c];
    adam_row(mu, g.mu, first, second, 3, n, plan.mu);
    adam_row(quat, g.quat, first + 3, second + 3, 4, n, plan.quat);
    adam_row(log_scale, g.log_scale, first + 7, second + 7, 3, n, plan.log_scale);
    adam_row(rgb, g.rgb, first + 10, second + 10, 3, n, plan.rgb);
    adam_row(&logit, &g.logit, first + 13, second + 13, 1, n, plan.opacity);
    float start[3] = {s.start[3 * i], s.start[3 * i + 1], s.start[3 * i + 2]};
    Bounds<float> bounds = {s.needle, s.least, s.largest[i], s.reach, s.tie, s.tied[i] != 0};
    limit(mu, quat, log_scale, rgb, logit, start, s.face_scale[i], bounds, plan.place_pull);
    for (int c = 0; c < 14; ++c) {
        s.first[size_t(c) * s.count + i] = first[c];
        s.second[size_t(c) * s.count + i] = second[c];
    }
    for (int c = 0; c < 3; ++c) {
        s.mu[3 * i + c] = mu[c];
        s.log_scale[3 * i + c] = log_scale[c];
        s.rgb[3 * i + c] = rgb[c];
    }
    for (int c = 0; c < 4; ++c) s.quat[4 * i + c] = quat[c];
    s.logit[i] = logit;
}

// (blocks of vertices, batch). A vertex's gradient: the corners of the gaussians on its faces, in their order; the same at rest
// where offsets or betas are learned.
extern "C" __global__ void __launch_bounds__(128) gather(Scene s) {
    if (halted(s)) return;
    int b = blockIdx.y, v = blockIdx.x * 128 + threadIdx.x;
    if (v >= s.vertex_count) return;
    const float *corners = s.corner_grad + 9 * size_t(b) * s.count;
    float x = 0, y = 0, z = 0;
    int end = s.vertex_start[v + 1];
#pragma unroll 4
    for (int e = s.vertex_start[v]; e < end; ++e) {
        const float *from = corners + 3 * s.vertex_item[e];
        x += from[0];
        y += from[1];
        z += from[2];
    }
    float *to = s.grad_vertices + 3 * (size_t(b) * s.vertex_count + v);
    to[0] = x;
    to[1] = y;
    to[2] = z;
    if (s.now[b].plan.offset == 0 && s.beta_count == 0 && !s.expression) return;
    Vec<float> at_rest = {0, 0, 0};
    for (int k = 0; k < 4; ++k) {
        float w = s.skin_weight[4 * v + k];
        const float *A = s.transform + (b * 55 + s.skin_index[4 * v + k]) * 12;
        at_rest.x += w * (A[0] * x + A[4] * y + A[8] * z);
        at_rest.y += w * (A[1] * x + A[5] * y + A[9] * z);
        at_rest.z += w * (A[2] * x + A[6] * y + A[10] * z);
    }
    to = s.grad_rest + 3 * (size_t(b) * s.vertex_count + v);
    to[0] = at_rest.x;
    to[1] = at_rest.y;
    to[2] = at_rest.z;
}

// Back through the joint chain for frame b of the batch, leaves first, then Adam of its pose; one block.
FORMULA void pose_step(const Scene &s, int b) {
    __shared__ float grad[55][12], up[55][12], transform[55][12], local[55][9];
    __shared__ float transl[3];
    __shared__ int child[55];
    const Now &now = s.now[b];
    int tid = threadIdx.x, j = tid, own_level = -1, p = 0, child_begin = 0, child_end = 0, n = 0;
    float J[3] = {}, g_local[9] = {};
    if (tid < 56) n = s.pose_steps[now.frame.pose] + 1;
    if (tid < 55) {
        own_level = s.joint_level[j];
        p = s.parents[j];
        child_begin = s.child_start[j];
        child_end = s.child_start[j + 1];
        for (int c = 0; c < 3; ++c) J[c] = s.joints[3 * j + c];
        child[j] = j < 54 ? s.child[j] : 0;
    }
    for (int i = tid; i < 55 * 12; i += blockDim.x) {
        (&grad[0][0])[i] = __ldcg(s.joint_grad + b * 55 * 12 + i);
        (&transform[0][0])[i] = s.transform[b * 55 * 12 + i];
    }
    for (int i = tid; i < 55 * 9; i += blockDim.x) (&local[0][0])[i] = s.local[b * 55 * 9 + i];
    __syncthreads();
    if (tid < 3) {  // weights of a vertex sum to one, so the joints' translations sum to the vertices' gradient
        float sum = 0;
        for (int k = 0; k < 55; ++k) sum += grad[k][4 * tid + 3];
        transl[tid] = sum;
    }
    __syncthreads();
    double turn[3] = {};
    for (int level = s.levels - 1; level >= 0; --level) {
        if (own_level == level) {
            float *G = grad[j];
            for (int e = child_begin; e < child_end; ++e)
                for (int c = 0; c < 12; ++c) G[c] += up[child[e]][c];
            const float *P = transform[p < 0 ? 0 : p], *L = local[j];
            if (s.grad_joints)
                for (int k = 0; k < 3; ++k) {
                    float g = p < 0 ? G[4 * k + 3] : 0;
                    for (int i = 0; i < 3; ++i) g += ((p < 0 ? 0 : P[4 * i + k]) - transform[j][4 * i + k]) * G[4 * i + 3];
                    s.grad_joints[(b * 55 + j) * 3 + k] = g;
                }
            for (int i = 0; i < 3; ++i)
                for (int k = 0; k < 3; ++k) G[4 * i + k] -= G[4 * i + 3] * J[k];
            for (int i = 0; i < 3; ++i)
                for (int k = 0; k < 3; ++k)
                    g_local[3 * i + k] = p < 0 ? G[4 * i + k] : P[i] * G[k] + P[4 + i] * G[4 + k] + P[8 + i] * G[8 + k];
            for (int i = 0; i < 3; ++i) {
                for (int k = 0; k < 3; ++k)
                    up[j][4 * i + k] = G[4 * i + 3] * J[k] + G[4 * i] * L[3 * k] + G[4 * i + 1] * L[3 * k + 1] + G[4 * i + 2] * L[3 * k + 2];
                up[j][4 * i + 3] = G[4 * i + 3];
            }
        }
        __syncthreads();
    }
    if (tid < 55) rodrigues_backward(s.pose + (now.frame.pose * 56 + j) * 3, g_local, turn);
    if (tid < 56) {
        size_t at = (size_t(now.frame.pose) * 56 + tid) * 3;
        double scale = 1 / (1 - pow(0.9, double(n))), unbias = 1 / (1 - pow(1 - s.fresh, double(n)));
        double unit = tid < 55 ? s.turn_unit : s.shift_unit, share = s.pose_share[tid];
        for (int c = 0; c < 3; ++c) {
            double g = tid < 55 ? turn[c] : double(transl[c]);
            if (s.pose_grad_out) s.pose_grad_out[(size_t(b) * 56 + tid) * 3 + c] = g;
            g = g / s.batch + 2 * s.pose_pull * (s.pose[at + c] - s.fit[at + c]) / (unit * unit);
            double first = s.pose_first[at + c] += 0.1 * (g - s.pose_first[at + c]);
            double second = s.pose_second[at + c] += s.fresh * (g * g - s.pose_second[at + c]);
            s.pose[at + c] -= share * now.plan.pose * first * scale / (sqrt(second * unbias) + s.tiny);
        }
    }
    __syncthreads();
    if (tid == 0) s.pose_steps[now.frame.pose] += 1;
}

// One step of the gains of a frame's channels against the sign of their gradients; the whole block.
FORMULA void gain_step(const Scene &s, int b, float *scratch) {
    const Now &now = s.now[b];
    int tiles = now.columns * now.rows;
    for (int k = 0; k < 3; ++k) {
        float sum = 0;
        for (int t = threadIdx.x; t < tiles; t += blockDim.x)
            if (s.tile_count[b * s.max_tiles + t]) sum += s.gain_part[3 * (b * s.max_tiles + t) + k];
        __syncthreads();
        sum = sum_block(sum, scratch);
        if (threadIdx.x > 0 || sum == 0) continue;
        s.gain[3 * now.frame.pose + k] = fminf(fmaxf(now.gain[k] - copysignf(now.plan.gain, sum), 0.5f), 2.0f);
    }
}

// (55 joints and one for the loss, batch). Gradient of each joint's transform, and the frame's loss; the last block of a frame
// takes the gradient to the pose, the last of the batch ends the step.
extern "C" __global__ void __launch_bounds__(512) joint_step(Scene s) {
    __shared__ float part[16][12], scratch[16];
    __shared__ int last;
    if (halted(s)) return;
    State &state = *s.state;
    int j = blockIdx.x, b = blockIdx.y, tid = threadIdx.x;
    const Now &now = s.now[b];
    if (j == 55) {
        float loss = 0;
        int tiles = now.columns * now.rows;
#pragma unroll 4
        for (int t = tid; t < tiles; t += 512)
            if (s.near_flag[b * s.max_tiles + t]) loss += s.tile_loss[b * s.max_tiles + t];
        loss = sum_block(loss, scratch);
        if (s.dice_weight > 0) loss += s.dice[1];
        if (s.pull) loss += float(s.pull_value[b] * PULL_UNIT);
        if (now.plan.centre >= 0) loss += s.perceptual * s.window_value[b];
        if (tid == 0) s.losses[state.step * s.batch + b] = loss;
        if (s.gain_part) gain_step(s, b, scratch);
    } else {
        const float *rest = s.rest + 3 * size_t(now.frame.rest) * s.vertex_count;
        const float *grad = s.grad_vertices + 3 * size_t(b) * s.vertex_count;
        float sum[12] = {};
        int end = s.joint_start[j + 1];
#pragma unroll 4
        for (int e = s.joint_start[j] + tid; e < end; e += 512) {
            int v = s.joint_vertex[e];
            float w = s.joint_weight[e];
            Vec<float> r = s.worn ? vec(s.worn + 3 * (size_t(b) * s.vertex_count + v)) : vec(rest + 3 * v) + vec(s.offset + 3 * v);
            for (int i = 0; i < 3; ++i) {
                float g = w * grad[3 * v + i];
                sum[4 * i] += g * r.x;
                sum[4 * i + 1] += g * r.y;
                sum[4 * i + 2] += g * r.z;
                sum[4 * i + 3] += g;
            }
        }
        for (int c = 0; c < 12; ++c) {
            float v = sum_warp(sum[c]);
            if (tid % 32 == 0) part[tid / 32][c] = v;
        }
        __syncthreads();
        if (tid < 12) {
            float v = 0;
            for (int w = 0; w < 16; ++w) v += part[w][tid];
            s.joint_grad[(b * 55 + j) * 12 + tid] = v;
        }
    }
    __threadfence();
    __syncthreads();
    if (tid == 0) last = atomicAdd(&state.joints_done[b], 1) == 55;
    __syncthreads();
    if (!last) return;
    __threadfence();
    pose_step(s, b);
    if (tid == 0) {
        __threadfence();
        if (atomicAdd(&state.frames_done, 1) == s.batch - 1) {
            state.frames_done = 0;
            state.step += 1;
        }
    }
}
