using System;
using System.Globalization;
using UnityEditor;
using UnityEngine;

namespace Gsac
{
    /// <summary>Inspector that shows while playing what comes in, and why something was refused.</summary>
    [CustomEditor(typeof(GsacPoseStream))]
    public sealed class GsacPoseStreamEditor : Editor
    {
        static readonly GsacMessageFault[] Faults = (GsacMessageFault[])Enum.GetValues(typeof(GsacMessageFault));

        public override bool RequiresConstantRepaint()
        {
            return Application.isPlaying;
        }

        public override void OnInspectorGUI()
        {
            DrawDefaultInspector();
            if (!Application.isPlaying) return;
            var stream = (GsacPoseStream)target;
            EditorGUILayout.LabelField("Messages taken", Word(stream.Received));
            foreach (GsacMessageFault fault in Faults)
            {
                int count = stream.RefusedFor(fault);
                if (count > 0) EditorGUILayout.LabelField("Refused: " + fault, Word(count));
            }
        }

        static string Word(int number)
        {
            return number.ToString(CultureInfo.InvariantCulture);
        }
    }
}
