// The body's mesh under the gaussians, which itself is never seen: shadow, depth, motion. A pass has included its pipeline's file.
#ifndef GSAC_BODY_INCLUDED
#define GSAC_BODY_INCLUDED

// m behind the body's surface at which its depth lies, where the gaussians are tested against it afterwards. They lie on both sides of
// the surface, clothes and an arm before the trunk far from it: 0.1 m costs 32 to 44 dB of the picture, 0.4 m 63 and more.
#ifndef GSAC_BEHIND
#define GSAC_BEHIND 0.4
#endif

struct GsacBodyVertex
{
    float4 place : POSITION;
    float3 normal : NORMAL;
    float3 before : TEXCOORD4; // place in the frame before
    UNITY_VERTEX_INPUT_INSTANCE_ID
};

struct GsacBodyVaryings
{
    float4 clip : SV_Position;
    UNITY_VERTEX_OUTPUT_STEREO
};

struct GsacMotionVaryings
{
    float4 clip : SV_Position;
    float4 now : TEXCOORD0;
    float4 before : TEXCOORD1;
    UNITY_VERTEX_OUTPUT_STEREO
};

// Where a point of the eye's space is drawn that is moved away from the eye, along its line of sight.
float4 GsacClipBehind(float3 eye, float4x4 projection)
{
    bool flat = projection[3][3] > 0.5;
    eye += flat ? float3(0, 0, -GSAC_BEHIND) : eye * (GSAC_BEHIND / max(length(eye), 1e-4));
    return mul(projection, float4(eye, 1));
}

float4 GsacNothing(GsacBodyVaryings input) : SV_Target
{
    return float4(0, 0, 0, 0);
}

// How far a point has gone on the screen since the frame before, in shares of the screen.
float2 GsacMotion(GsacMotionVaryings input)
{
    float2 way = 0.5 * (input.now.xy / input.now.w - input.before.xy / input.before.w);
#if UNITY_UV_STARTS_AT_TOP
    way.y = -way.y;
#endif
    return way;
}

#endif
