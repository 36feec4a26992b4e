// The body's mesh in what a pipeline draws beside the picture: shadows, the depth texture, motion vectors. Nothing of it is seen, and
// it writes no depth before the sky is drawn, which would leave holes: GsacBodyDepth.shader does so after it.
Shader "Gsac/Body"
{
    SubShader
    {
        PackageRequirements { "com.unity.render-pipelines.high-definition": "12.0.0" }
        Tags { "RenderPipeline" = "HDRenderPipeline" "RenderType" = "Opaque" "Queue" = "Geometry" }
        Pass
        {
            Name "ShadowCaster"
            Tags { "LightMode" = "ShadowCaster" }
            ColorMask 0
            ZWrite On
            ZTest LEqual
            Cull Back

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment GsacNothing
            #pragma multi_compile_instancing
            #include "Packages/com.unity.render-pipelines.core/ShaderLibrary/Common.hlsl"
            #include "Packages/com.unity.render-pipelines.high-definition/Runtime/ShaderLibrary/ShaderVariables.hlsl"
            #include "GsacBody.hlsl"

            GsacBodyVaryings Vertex(GsacBodyVertex input)
            {
                GsacBodyVaryings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                output.clip = mul(UNITY_MATRIX_VP, float4(TransformObjectToWorld(input.place.xyz), 1));
                return output;
            }
            ENDHLSL
        }

        Pass
        {
            Name "MotionVectors"
            Tags { "LightMode" = "MotionVectors" }
            ZWrite Off
            ZTest LEqual
            Cull Back

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #pragma multi_compile_instancing
            #include "Packages/com.unity.render-pipelines.core/ShaderLibrary/Common.hlsl"
            #include "Packages/com.unity.render-pipelines.high-definition/Runtime/ShaderLibrary/ShaderVariables.hlsl"
            #include "GsacBody.hlsl"

            GsacMotionVaryings Vertex(GsacBodyVertex input)
            {
                GsacMotionVaryings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                float4 world = float4(TransformObjectToWorld(input.place.xyz), 1);
                float4 before = float4(unity_MotionVectorsParams.x > 0 ? input.before : input.place.xyz, 1);
                output.clip = mul(UNITY_MATRIX_VP, world);
                output.now = mul(UNITY_MATRIX_UNJITTERED_VP, world);
                output.before = mul(UNITY_MATRIX_PREV_VP, mul(UNITY_PREV_MATRIX_M, before));
                return output;
            }

            float4 Fragment(GsacMotionVaryings input) : SV_Target
            {
                return GsacMotion(input).xyxy;
            }
            ENDHLSL
        }
    }

    SubShader
    {
        PackageRequirements { "com.unity.render-pipelines.universal": "12.0.0" }
        Tags { "RenderPipeline" = "UniversalPipeline" "RenderType" = "Opaque" "Queue" = "Geometry" }
        Pass
        {
            Name "ShadowCaster"
            Tags { "LightMode" = "ShadowCaster" }
            ColorMask 0
            ZWrite On
            ZTest LEqual
            Cull Back

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment GsacNothing
            #pragma multi_compile_instancing
            #pragma multi_compile_vertex _ _CASTING_PUNCTUAL_LIGHT_SHADOW
            #include "Packages/com.unity.render-pipelines.universal/ShaderLibrary/Core.hlsl"
            #include "Packages/com.unity.render-pipelines.universal/ShaderLibrary/Shadows.hlsl"
            #include "GsacBody.hlsl"

            float3 _LightDirection;
            float3 _LightPosition;

            GsacBodyVaryings Vertex(GsacBodyVertex input)
            {
                GsacBodyVaryings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                float3 world = TransformObjectToWorld(input.place.xyz);
                float3 normal = TransformObjectToWorldNormal(input.normal);
            #if _CASTING_PUNCTUAL_LIGHT_SHADOW
                float3 light = normalize(_LightPosition - world);
            #else
                float3 light = _LightDirection;
            #endif
                output.clip = TransformWorldToHClip(ApplyShadowBias(world, normal, light));
            #if UNITY_REVERSED_Z
                output.clip.z = min(output.clip.z, UNITY_NEAR_CLIP_VALUE);
            #else
                output.clip.z = max(output.clip.z, UNITY_NEAR_CLIP_VALUE);
            #endif
                return output;
            }
            ENDHLSL
        }

        Pass
        {
            Name "DepthOnly"
            Tags { "LightMode" = "DepthOnly" }
            ColorMask 0
            ZWrite On
            ZTest LEqual
            Cull Back

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment GsacNothing
            #pragma multi_compile_instancing
            #include "Packages/com.unity.render-pipelines.universal/ShaderLibrary/Core.hlsl"
            // a depth texture: only with depth priming are gaussians tested against it
            #define GSAC_BEHIND 0.1
            #include "GsacBody.hlsl"

            GsacBodyVaryings Vertex(GsacBodyVertex input)
            {
                GsacBodyVaryings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                float3 world = TransformObjectToWorld(input.place.xyz);
                output.clip = GsacClipBehind(mul(UNITY_MATRIX_V, float4(world, 1)).xyz, UNITY_MATRIX_P);
                return output;
            }
            ENDHLSL
        }

        Pass
        {
            Name "MotionVectors"
            PackageRequirements { "com.unity.render-pipelines.universal": "14.0.0" }
            Tags { "LightMode" = "MotionVectors" }
            ZWrite Off
            ZTest LEqual
            Cull Back

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #pragma multi_compile_instancing
            #include "Packages/com.unity.render-pipelines.universal/ShaderLibrary/Core.hlsl"
            #include "GsacBody.hlsl"

            GsacMotionVaryings Vertex(GsacBodyVertex input)
            {
                GsacMotionVaryings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                float4 world = float4(TransformObjectToWorld(input.place.xyz), 1);
                float4 before = float4(unity_MotionVectorsParams.x > 0 ? input.before : input.place.xyz, 1);
                output.clip = mul(UNITY_MATRIX_VP, world);
                output.now = mul(_NonJitteredViewProjMatrix, world);
                output.before = mul(_PrevViewProjMatrix, mul(unity_MatrixPreviousM, before));
                return output;
            }

            float4 Fragment(GsacMotionVaryings input) : SV_Target
            {
                return float4(GsacMotion(input), 0, 0);
            }
            ENDHLSL
        }
    }

    SubShader
    {
        Tags { "RenderType" = "Opaque" "Queue" = "Geometry" }
        Pass
        {
            Name "ShadowCaster"
            Tags { "LightMode" = "ShadowCaster" }
            ColorMask 0
            ZWrite On
            ZTest LEqual
            Cull Back

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment GsacNothing
            #pragma multi_compile_instancing
            #include "UnityCG.cginc"
            #include "GsacBody.hlsl"

            GsacBodyVaryings Vertex(GsacBodyVertex input)
            {
                GsacBodyVaryings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                output.clip = UnityApplyLinearShadowBias(UnityClipSpaceShadowCasterPos(input.place, input.normal));
                return output;
            }
            ENDHLSL
        }

        Pass
        {
            Name "MotionVectors"
            Tags { "LightMode" = "MotionVectors" }
            ZWrite Off
            ZTest LEqual
            Cull Back

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #pragma multi_compile_instancing
            #include "UnityCG.cginc"
            #include "GsacBody.hlsl"

            float4x4 _NonJitteredVP;
            float4x4 _PreviousVP;
            float4x4 _PreviousM;
            bool _HasLastPositionData;

            GsacMotionVaryings Vertex(GsacBodyVertex input)
            {
                GsacMotionVaryings output;
                UNITY_SETUP_INSTANCE_ID(input);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
                float4 world = mul(unity_ObjectToWorld, float4(input.place.xyz, 1));
                output.clip = mul(UNITY_MATRIX_VP, world);
                output.now = mul(_NonJitteredVP, world);
                output.before = mul(_PreviousVP, mul(_PreviousM, float4(_HasLastPositionData ? input.before : input.place.xyz, 1)));
                return output;
            }

            float4 Fragment(GsacMotionVaryings input) : SV_Target
            {
                return float4(GsacMotion(input), 0, 1);
            }
            ENDHLSL
        }
    }
}
