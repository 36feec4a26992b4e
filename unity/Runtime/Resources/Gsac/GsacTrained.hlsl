// Lays the avatar's own picture over the scene. The pass has included its pipeline's file, which brings UNITY_MATRIX_V, UNITY_MATRIX_P
// and the stereo macros, and says GSAC_ORIGIN (place of the pipeline's origin); its fragment program brings what lies behind.
#include "GsacDraw.hlsl"
#include "GsacFinish.hlsl"
#include "GsacLatest.hlsl"

#define GSAC_STAND_IN 8 // px: a texture that small is Unity's for one that is not there

float4 GsacEyeScreen;       // px of the picture; m from the eye at which it is laid over the scene, whether a copy of that may be used
uint GsacParts;             // of the picture, side by side: one for each eye
float4 GsacEyePlace[2];     // of each eye, in the world; of a camera with one eye twice the same
float4 GsacEyeRect[2];      // clip x and y of the part's lower left and upper right corner, y up
float4 GsacEyeLens[2];      // of the eye's own projection, y up: clip x and y of the eye's, what shifts them
Texture2D<float4> GsacTrained;     // display colour, premultiplied; alpha
Texture2D<float> GsacTrainedDepth; // mean depth, m, premultiplied
SamplerState GsacLinearClampSampler;

struct GsacInput
{
    uint vertex : SV_VertexID;
    UNITY_VERTEX_INPUT_INSTANCE_ID
};

struct GsacLaidVaryings
{
    float4 clip : SV_Position;
    float2 place : TEXCOORD0;
    float2 side : TEXCOORD1; // m to the right and up: a metre ahead, or at any distance where all lines of sight run side by side
    UNITY_VERTEX_OUTPUT_STEREO
};

struct GsacLaidPixel
{
    float4 colour : SV_Target;
    float depth : SV_Depth;
};

// Clip space of what lies `depth` m ahead.
float4 GsacAhead(float2 side, float depth, float4x4 projection)
{
    return mul(projection, float4(GsacLensOf(projection).flat ? side : side * depth, -depth, 1));
}

// The eye that is drawn for: told by its place, which every way of drawing two eyes gives.
uint GsacEye(float4x4 view, float3 origin)
{
    float3 place = origin - mul(transpose((float3x3)view), float3(view[0][3], view[1][3], view[2][3]));
    return distance(place, GsacEyePlace[1].xyz) < distance(place, GsacEyePlace[0].xyz) ? 1 : 0;
}

// input.vertex: of 4, the corners of the eye's part.
GsacLaidVaryings Vertex(GsacInput input)
{
    GsacLaidVaryings output;
    UNITY_SETUP_INSTANCE_ID(input);
    UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
    uint eye = GsacEye(UNITY_MATRIX_V, GSAC_ORIGIN);
    float2 place = float2((input.vertex & 1) ? 1.0 : 0.0, (input.vertex & 2) ? 1.0 : 0.0);
    float2 corner = lerp(GsacEyeRect[eye].xy, GsacEyeRect[eye].zw, place);
    output.side = (corner + GsacEyeLens[eye].zw) / GsacEyeLens[eye].xy;
    output.clip = GsacIfLatest(GsacAhead(output.side, GsacEyeScreen.z, UNITY_MATRIX_P));
    output.place = float2((place.x + eye) / GsacParts, place.y);
    return output;
}

// A copy of the scene has a slice for each eye where both are drawn at once.
#if defined(UNITY_STEREO_INSTANCING_ENABLED) || defined(UNITY_STEREO_MULTIVIEW_ENABLED)
#define GsacCopy Texture2DArray<float4>
float4 GsacCopied(GsacCopy copy, float2 place, out float2 size)
{
    float slices;
    copy.GetDimensions(size.x, size.y, slices);
    return copy.Sample(GsacLinearClampSampler, float3(place, unity_StereoEyeIndex));
}
#else
#define GsacCopy Texture2D<float4>
float4 GsacCopied(GsacCopy copy, float2 place, out float2 size)
{
    copy.GetDimensions(size.x, size.y);
    return copy.Sample(GsacLinearClampSampler, place);
}
#endif

// behind: linear light of what lies there, and alpha; size: px of the picture that it is from, a few where there is none.
GsacLaidPixel GsacLay(GsacLaidVaryings input, float4x4 projection, float4 behind, float2 size)
{
    GsacFade(input.clip.xy);
    float4 trained = GsacTrained.Sample(GsacLinearClampSampler, input.place);
    clip(trained.a - GsacBlend.z);
    GsacLaidPixel pixel;
    // a headset shows the room where nothing was drawn, and nobody knows that
    bool known = size.x > GSAC_STAND_IN && GsacEyeScreen.w > 0.5 && (behind.a > 0 || GsacParts == 1);
    pixel.colour = GsacOver(trained, behind.rgb, known);
    float depth = GsacTrainedDepth.Sample(GsacLinearClampSampler, input.place) / trained.a;
    float4 place = GsacAhead(input.side, depth, projection);
    pixel.depth = saturate(place.z / place.w);
    float alpha = max(pixel.colour.a, 1e-6);
    pixel.colour.rgb = alpha * GsacThroughFog(pixel.colour.rgb / alpha, place);
    return pixel;
}
