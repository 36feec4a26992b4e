using System.Collections.Generic;
using UnityEditor;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>GSAC > Self-check: a person of the project imported, checked and drawn in each render pipeline; a JSON file for each.</summary>
    public static class GsacSelfCheckMenu
    {
        const int Settling = 20; // updates of the editor after a change of the pipeline

        static readonly Queue<RenderPipelineAsset> Waiting = new Queue<RenderPipelineAsset>();
        static RenderPipelineAsset usual, usualOfQuality;
        static GsacAvatar person;
        static int settled;

        /// <summary>The files of the last time.</summary>
        public static readonly List<string> Written = new List<string>();

        [MenuItem("GSAC/Self-check")]
        public static void Begin()
        {
            GsacAvatar[] people = GsacCastFiller.FindPeople();
            if (people.Length == 0 || Application.isPlaying || person != null)
            {
                EditorUtility.DisplayDialog("GSAC self-check", people.Length == 0
                    ? "There is nobody in this project: drag an avatar.gsac into the Project window, then start the self-check again."
                    : "Leave play mode, or wait for the self-check that runs.", "OK");
                return;
            }
            Written.Clear();
            Waiting.Enqueue(null); // the built-in pipeline
            foreach (string guid in AssetDatabase.FindAssets("t:RenderPipelineAsset"))
            {
                var pipeline = AssetDatabase.LoadAssetAtPath<RenderPipelineAsset>(AssetDatabase.GUIDToAssetPath(guid));
                if (pipeline != null) Waiting.Enqueue(pipeline);
            }
            usual = GraphicsSettings.defaultRenderPipeline;
            usualOfQuality = QualitySettings.renderPipeline;
            person = Object.Instantiate(people[0]);
            person.gameObject.hideFlags = HideFlags.DontSave;
            Use(Waiting.Peek());
            EditorApplication.update += Next;
        }

        static void Next()
        {
            if (++settled < Settling)
            {
                EditorApplication.QueuePlayerLoopUpdate();
                return;
            }
            bool more = false;
            try
            {
                RenderPipelineAsset pipeline = Waiting.Dequeue();
                Written.Add(GsacSelfCheck.Write(person, GsacSelfCheck.PipelineName(pipeline), GsacSelfCheck.Look(person)));
                more = Waiting.Count > 0;
                if (more) Use(Waiting.Peek());
            }
            finally
            {
                if (!more) End();
            }
        }

        static void Use(RenderPipelineAsset pipeline)
        {
            GraphicsSettings.defaultRenderPipeline = pipeline;
            QualitySettings.renderPipeline = pipeline;
            settled = 0;
        }

        static void End()
        {
            EditorApplication.update -= Next;
            Waiting.Clear();
            GraphicsSettings.defaultRenderPipeline = usual;
            QualitySettings.renderPipeline = usualOfQuality;
            Object.DestroyImmediate(person.gameObject);
            person = null;
            if (Written.Count > 0) EditorUtility.RevealInFinder(Written[0]);
        }
    }
}
