// The body's depth, behind its surface, after the sky and before all transparent things: for depth of field and fog, and so
// that transparent things behind the person are hidden by her.
Shader "Gsac/Body Depth"
{
    SubShader
    {
        PackageRequirements { "com.unity.render-pipelines.high-definition": "12.0.0" }
        Tags { "RenderPipeline" = "HDRenderPipeline" "RenderType" = "Transparent" "Queue" = "Transparent-100" }
        Pass
        {
            Name "TransparentDepthPostpass"
            Tags { "LightMode" = "TransparentDepthPostpass" }
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
            // nothing is tested against it but effects on the whole picture
            #define GSAC_BEHIND 0
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
    }

    SubShader
    {
        PackageRequirements { "com.unity.render-pipelines.universal": "12.0.0" }
        Tags { "RenderPipeline" = "UniversalPipeline" "RenderType" = "Transparent" "Queue" = "Transparent-100" }
        Pass
        {
            Name "Depth"
            Tags { "LightMode" = "UniversalForward" }
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
    }

    SubShader
    {
        Tags { "RenderType" = "Transparent" "Queue" = "Transparent-100" }
        Pass
        {
            Name "Depth"
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
                float3 world = mul(unity_ObjectToWorld, float4(input.place.xyz, 1)).xyz;
                output.clip = GsacClipBehind(mul(UNITY_MATRIX_V, float4(world, 1)).xyz, UNITY_MATRIX_P);
                return output;
            }
            ENDHLSL
        }
    }
}
