Shader "Gsac/Samples/Room Depth"
{
    // Writes how far the real room is, and no colour, before all that is transparent. Where on the depth picture a pixel lies depends on how
    // far it is: it is looked up at the person's distance, where being before or behind her is decided.
    SubShader
    {
        Tags { "Queue" = "Geometry-100" "RenderType" = "Opaque" }
        Pass
        {
            ZWrite On
            ZTest LEqual
            Cull Off
            ColorMask 0

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #pragma multi_compile_instancing
            #include "UnityCG.cginc"

#if defined(UNITY_STEREO_INSTANCING_ENABLED) || defined(UNITY_STEREO_MULTIVIEW_ENABLED) || defined(USING_STEREO_MATRICES)
            #define GSAC_EYE unity_StereoEyeIndex
#else
            #define GSAC_EYE 0
#endif

            Texture2DArray<float> GsacRoomDepth;
            SamplerState sampler_GsacRoomDepth;
            float4x4 GsacRoomFromWorld[2];
            float4 GsacRoomMetres;
            float GsacRoomAway;

            struct Input
            {
                float3 place : POSITION;
                UNITY_VERTEX_INPUT_INSTANCE_ID
            };

            struct Varyings
            {
                float4 clip : SV_Position;
                float2 screen : TEXCOORD0;
                UNITY_VERTEX_OUTPUT_STEREO
            };

            Varyings Vertex(Input input)
            {
                Varyings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                output.clip = float4(input.place.xy, 0.5, 1);
                output.screen = input.place.xy;
                return output;
            }

            float Fragment(Varyings input) : SV_Depth
            {
                UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input);
                float4x4 lens = UNITY_MATRIX_P;
                float4x4 view = UNITY_MATRIX_V;
                // the place on this pixel's ray at the person's distance along the view
                float3 eye = float3((input.screen.x + lens[0][2]) / lens[0][0], (input.screen.y + lens[1][2]) / lens[1][1], -1) * GsacRoomAway;
                float3 moved = eye - float3(view[0][3], view[1][3], view[2][3]);
                float3 world = mul(transpose((float3x3)view), moved);
                float4 there = mul(GsacRoomFromWorld[GSAC_EYE], float4(world, 1));
                float2 at = there.xy / there.w * 0.5 + 0.5;
                bool known = there.w > 0 && all(at >= 0) && all(at <= 1);
                float measured = GsacRoomDepth.SampleLevel(sampler_GsacRoomDepth, float3(at, GSAC_EYE), 0);
                float metres = GsacRoomMetres.x / (measured * 2 - 1 + GsacRoomMetres.y);
                if (!known || !(metres > 0)) discard;
                return (lens[2][3] - lens[2][2] * metres) / metres;
            }
            ENDHLSL
        }
    }
}
